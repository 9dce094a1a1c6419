//! Noise that is far from what `[sensors]` says is said before the fit, as the doctor says it.

use crate::case::{Case, slosh, trajectory};
use serde_json::Value;

fn problems(c: &Case, args: &[&str]) -> (i32, Vec<Value>) {
    let (code, out, err) = c.run(&[args, &["--record", "rec.csv", "--json"]].concat());
    let v: Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {out}{err}"));
    (code, v["problems"].as_array().unwrap().clone())
}

fn of<'p>(all: &'p [Value], code: &str) -> Vec<&'p Value> {
    all.iter().filter(|p| p["code"] == code).collect()
}

#[test]
#[ignore = "full tier: 4 s"]
fn noise_that_is_ten_times_what_the_mission_says_is_named_before_the_fit() {
    let c = slosh();
    c.write("a.csv", &trajectory(8.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let (code, clean) = problems(&c, &["identify", "m.toml", "--out", "clean"]);
    assert_eq!((code, of(&clean, "Data::NoiseFigure").len()), (0, 0), "{clean:?}");
    let told = |nm: &str, rad_per_s: &str| {
        let text = c.read("m.toml").replace("noise_std_nm = 0.1 ", &format!("noise_std_nm = {nm} "));
        let of_gyro = format!("noise_std_rad_per_s = {rad_per_s} ");
        text.replace("noise_std_rad_per_s = 1.5e-4 ", &of_gyro)
    };
    for (file, nm, rad_per_s, exit) in [("less.toml", "0.01", "1.5e-5", 16), ("more.toml", "1.0", "1.5e-3", 0)] {
        c.write(file, &told(nm, rad_per_s));
        let (_, doctor) = problems(&c, &["doctor", file]);
        let (code, found) = problems(&c, &["identify", file, "--out", file.trim_end_matches(".toml")]);
        let of_fit = of(&found, "Data::NoiseFigure");
        assert_eq!(of_fit, of(&doctor, "Data::NoiseFigure"), "{file}");
        assert_eq!((code, of_fit.len()), (exit, 2), "{file}: {found:?}");
        let r = c.result(file.trim_end_matches(".toml"));
        assert_eq!(r.warnings.iter().filter(|w| w.code == "Data::NoiseFigure").count(), 2, "{file}");
        // A contradiction that is no more than that points there.
        let hint = of(&found, "Fit::Misfit").first().map(|p| p["hint"].as_str().unwrap().to_owned());
        let figure = of_fit[0]["hint"].as_str().unwrap();
        assert_eq!(hint.is_some(), exit == 16);
        assert!(hint.is_none_or(|h| h.contains("the noise of tau") && h.contains(figure)), "{found:?}");
    }
}
