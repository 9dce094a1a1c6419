//! What tests and tasks are built with.

use std::process::Command;

/// Variables of `.ci/environment`, which says why, for this machine. A command of the project compiles a third less with them: a first
/// `reproduce` is minutes sooner at its tables. Benchmarks, wheels and studies of times, which are built for any machine, take none of them.
fn variables() -> Vec<(&'static str, &'static str)> {
    let mut all = vec![("CARGO_INCREMENTAL", "0"), ("CARGO_PROFILE_DEV_CODEGEN_UNITS", "1")];
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
        all.push(("RUSTFLAGS", "--cfg ff_isa=\"v3\""));
    }
    all
}

/// Sets the variables for a command of Cargo, but for those that the caller has set.
pub fn set(command: &mut Command) {
    for (name, value) in variables() {
        if std::env::var_os(name).is_none() {
            command.env(name, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One build serves `.ci/run`, `cargo xtask test` and every task.
    #[test]
    fn it_is_the_environment_of_continuous_integration() {
        let root = crate::workspace::root().unwrap();
        let text = std::fs::read_to_string(root.join(".ci/environment")).unwrap().replace('\\', "");
        for (name, value) in variables() {
            let set =
                text.contains(&format!("{name}={value} ")) || text.contains(&format!("{name}=${{{name}:-{value}}}"));
            assert!(set, "{name}={value} is not in\n{text}");
        }
    }
}
