//! What the names of parameters mean, for readers who have not met them.

use ffid::workflow::identify::Parameter;

/// The last part of a name without its index: `k` of `wing.k[0]`.
fn stem(name: &str) -> &str {
    let last = name.rsplit('.').next().unwrap_or(name);
    last.split('[').next().unwrap_or(last)
}

/// What a parameter is, in a word; `None` where its name says so itself or says something else here.
pub(super) fn kind(p: &Parameter) -> Option<&'static str> {
    match (stem(&p.name), p.unit.as_str()) {
        ("k", "N m/rad" | "N/m") => Some("stiffness"),
        ("d", "N m s/rad" | "N s/m") => Some("damping"),
        ("rest", "rad" | "m") => Some("relaxed position"),
        ("h_x" | "h_y" | "h_z", "kg m") => Some("first moment of mass"),
        ("i_xx" | "i_xy" | "i_yy" | "i_xz" | "i_yz" | "i_zz", "kg m^2") => Some("inertia"),
        _ => None,
    }
}

/// A sentence for every kind of name among the parameters; empty where all speak for themselves.
pub(super) fn meanings(all: &[Parameter]) -> String {
    const SAID: [(&str, &str); 5] = [
        ("first moment of mass", "h_x, h_y, h_z: first moment of mass, that is mass times centre of mass."),
        ("inertia", "i_xx to i_zz: elements of the inertia matrix about the origin of the body's frame."),
        ("stiffness", "k[0], k[1], ...: stiffness of each spring, of a panel's hinges from the root to the tip."),
        ("damping", "d[0], d[1], ...: damping beside these springs."),
        ("relaxed position", "rest[0], rest[1], ...: where these springs are relaxed."),
    ];
    let has = |of: &str| all.iter().any(|p| kind(p) == Some(of));
    SAID.iter().filter(|(of, _)| has(of)).map(|(_, said)| *said).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use ffid::workflow::identify::ParameterVerdict;

    fn parameter(name: &str, unit: &str) -> Parameter {
        Parameter {
            name: name.into(),
            unit: unit.into(),
            start: 1.5,
            value: 1.7,
            std: None,
            std_coloured: None,
            interval95: None,
            prior_mean: None,
            prior_std: None,
            truth: None,
            verdict: ParameterVerdict::Estimated,
        }
    }

    #[test]
    fn kinds_follow_from_name_and_unit_and_only_those_there_are_explained() {
        let all = [("base.mass", "kg"), ("wing.k[1]", "N m/rad"), ("tank.d[0]", "N m s/rad"), ("base.i_xy", "kg m^2")];
        let all = all.map(|(n, u)| parameter(n, u));
        assert_eq!(all.each_ref().map(kind), [None, Some("stiffness"), Some("damping"), Some("inertia")]);
        let said = meanings(&all);
        assert!(
            said.contains("k[0]") && said.contains("d[0]") && said.contains("i_xx") && !said.contains("h_x"),
            "{said}"
        );
        // The same letter with another unit is something else.
        assert_eq!(kind(&parameter("wheel.d", "N m s/rad")), Some("damping"));
        assert_eq!((kind(&parameter("own.k", "1")), meanings(&[parameter("base.mass", "kg")])), (None, String::new()));
    }
}
