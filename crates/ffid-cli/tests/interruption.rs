//! What an interruption leaves of `ffid identify` (R03).

use crate::case::{slosh, trajectory};
use ff_mission::Leniency;
use ffid::exit::Exit;
use ffid::open::open;
use ffid::workflow::identify::{Ended, Observer};
use ffid_cli::session;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stopped at its third linearisation, a fit is a result that has not ended, and is written; stopped before the first it is an error, and so it is
/// for a caller that keeps its best point by itself.
#[test]
fn a_fit_that_is_interrupted_is_written_as_far_as_it_got() {
    let c = slosh();
    c.write("a.csv", &trajectory(8.0, 0.2));
    c.simulate("truth.toml", "a.csv", "rec.csv", &["--seed", "4"]);
    let file = c.path("m.toml");
    let opened = open(&file, Leniency::default()).unwrap();
    let records = [session::read_record(&opened.model, &c.path("rec.csv"), &[]).unwrap()];
    let (stop, options) = (AtomicBool::new(false), ["--held-out=0.3".to_owned()]);
    let at_the_third = |n: usize, _: f64| stop.store(n >= 3, Ordering::SeqCst);
    let watch = Observer { stop: Some(&stop), progress: Some(&at_the_third), partial: true, ..Observer::default() };
    let mut found = session::identify(&file, &opened, &records, None, &options, &watch).ok().unwrap();
    let r = found.found.result.clone();
    assert_eq!((found.exit, r.status), (Exit::Interrupted, Ended::Interrupted { after: r.iterations }));
    assert!((3..=4).contains(&r.iterations) && r.held_out.is_none() && r.parameters.len() == 14);
    assert!(r.parameters.iter().all(|p| p.std.is_some()) && r.parameters.iter().any(|p| p.value != p.start));
    let said = format!("was interrupted after {} linearisations", r.iterations);
    assert!(r.verdict[0].contains("did NOT end") && r.verdict[0].contains(&said), "{:?}", r.verdict);
    let problem = found.problems.0.iter().find(|p| p.code == "Fit::Interrupted").unwrap();
    assert!(problem.message.contains(&said) && problem.hint.is_some(), "{problem}");
    found.save(&c.path("res"), false, false).unwrap();
    assert!(c.result("res").status.is_interrupted() && c.read("res/report.txt").contains(&said));
    // Values that are no solution are not made into a robot.
    assert!(!c.path("res/identified.toml").exists());

    assert!(stop.load(Ordering::SeqCst));
    let whole = Observer { partial: false, ..watch };
    for (watch, at) in [(watch, true), (whole, false)] {
        stop.store(at, Ordering::SeqCst);
        let refused = session::identify(&file, &opened, &records, None, &options, &watch).err().unwrap();
        assert_eq!(refused.exit, Exit::Interrupted);
        assert!(refused.problems.0[0].message.contains("before anything was fitted"), "{}", refused.problems);
    }
}
