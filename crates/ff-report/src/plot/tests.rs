//! Figures as a whole: what is drawn, what is refused, what is written.

use crate::plot::*;

fn spectrum() -> Figure {
    let f: Vec<f64> = (0..20_000).map(|i| i as f64 * 1e-4).collect();
    let s: Vec<f64> = f.iter().map(|f| 1.0 / ((f * f - 0.05).powi(2) + 1e-6)).collect();
    let p = Panel::log_y("frequency (Hz)", "PSD ((N m)²/Hz)").curve("joint 2", &f, &s).vline(0.2236, "mode <1> & 2");
    Figure::new("Spectrum").panel(p).caption("One mode.")
}

#[test]
fn svg_is_small_well_formed_and_says_what_it_shows() {
    let svg = spectrum().to_svg().unwrap();
    assert!(svg.len() < 40_000, "{} bytes", svg.len());
    for part in ["<title>Spectrum</title>", "joint 2", "frequency (Hz)", "One mode.", "mode &lt;1&gt; &amp; 2", "10⁻"]
    {
        assert!(svg.contains(part), "no {part:?} in the SVG");
    }
}

#[test]
fn writes_both_files_and_the_same_bytes_every_time() {
    let dir = tempfile::tempdir().unwrap();
    let read = |stem: &str| {
        let paths = spectrum().write(&dir.path().join("figures").join(stem)).unwrap();
        assert!(paths[1].ends_with(format!("{stem}.png")));
        paths.map(|p| std::fs::read(p).unwrap())
    };
    let [svg, png] = read("fig5.first"); // a dot in the stem is part of the name
    assert_eq!([svg, png.clone()], read("fig5.second"));
    assert_eq!(&png[1..4], b"PNG");
}

/// Without the built-in font the text would silently vanish from the PNG: compare with and without title.
#[test]
fn text_is_rendered_without_system_fonts() {
    let with = raster::png(&spectrum().to_svg().unwrap()).unwrap();
    let blank = spectrum().to_svg().unwrap().replace("joint 2", " ");
    assert_ne!(with, raster::png(&blank).unwrap());
}

#[test]
fn refuses_non_finite_and_unequal_series() {
    let f = Figure::new("F").panel(Panel::new("x", "y").curve("bad", &[0.0, 1.0], &[0.0, f64::NAN]));
    let e = f.to_svg().unwrap_err().to_string();
    assert!(e.contains("series 'bad'") && e.contains("sample 1"), "{e}");
    let f = Figure::new("F").panel(Panel::new("x", "y").curve("bad", &[0.0], &[]));
    assert!(matches!(f.to_svg(), Err(Failure::Length { left: 1, right: 0, .. })));
}

#[test]
fn empty_and_degenerate_panels_are_drawn() {
    let zeros = [0.0; 3];
    let f = Figure::new("")
        .panel(Panel::new("x", "y"))
        .panel(Panel::log_y("x", "y").curve("all zero", &[0.0, 1.0, 2.0], &zeros))
        .panel(Panel::new("x", "y").curve("one point", &[1.0], &[1.0]));
    assert!(f.to_svg().unwrap().contains("all zero"));
}

/// A factor of the tick labels belongs to the unit: "× 10⁴" beside it could be read both ways.
#[test]
fn power_of_ten_is_part_of_the_unit() {
    let f = Figure::new("").panel(Panel::new("time (s)", "rate (rad/s)").curve("x", &[0.0, 1.0], &[-3e-4, 3e-4]));
    assert!(f.to_svg().unwrap().contains("rate (10⁻⁴ rad/s)"));
}

#[test]
fn what_lies_outside_or_has_no_name_takes_no_room() {
    let base = Panel::new("x (m)", "y (m)").curve("a", &[0.0, 1.0], &[0.0, 1.0]);
    let more = base.clone().vline(7.0, "outside").curve("", &[0.0, 1.0], &[1.0, 0.0]);
    let height = |p: Panel| {
        let svg = Figure::new("").panel(p).to_svg().unwrap();
        assert!(!svg.contains("outside"));
        svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap().to_owned()
    };
    assert_eq!(height(base), height(more));
}

/// A curve that is zero would hide what crosses it: it is drawn before the others, and its name says why it cannot be seen.
#[test]
fn a_curve_that_is_zero_is_under_the_others_and_named() {
    let x = [0.0, 1.0, 2.0];
    let p = Panel::new("x (m)", "y (m)").curve("moves", &x, &[0.0, 1.0, 0.5]).curve("still", &x, &[0.0, 1e-12, 0.0]);
    let svg = Figure::new("").panel(p.clone()).to_svg().unwrap();
    assert!(svg.contains("still (zero)") && !svg.contains("moves (zero)"));
    // The last stroke in a colour is its curve; those before are the legend.
    let last = |colour: &str| svg.rfind(colour).unwrap();
    assert!(last("#D55E00") < last("#0072B2"), "{svg}");
    // One curve alone is what it is, and a logarithm has no zero.
    let alone = Panel::new("x (m)", "y (m)").curve("still", &x, &[0.0; 3]);
    assert!(!Figure::new("").panel(alone).to_svg().unwrap().contains("(zero)"));
}

#[test]
fn marks_without_a_name_leave_no_stub_and_take_no_row() {
    let base = Panel::new("x (m)", "y (m)").curve("a", &[0.0, 1.0], &[0.0, 1.0]);
    let svg = |p: Panel| Figure::new("").panel(p).to_svg().unwrap();
    let height = |s: &str| s.split("height=\"").nth(1).unwrap().split('"').next().unwrap().to_owned();
    let (plain, marked) = (svg(base.clone()), svg(base.clone().vline(0.5, "")));
    assert_eq!(height(&plain), height(&marked));
    assert_ne!(plain, marked);
    assert_ne!(height(&plain), height(&svg(base.vline(0.5, "half"))));
}

#[test]
fn a_corner_plot_has_every_pair_and_refuses_draws_that_are_not_finite() {
    let draws: Vec<Vec<f64>> =
        (0..3).map(|k| (0..200).map(|i| (f64::from(i * (k + 3)) * 0.7).sin()).collect()).collect();
    let corner = Corner {
        names: ["tank.mass (kg)", "tank.length (m)", "a<b (1)"].map(String::from).to_vec(),
        draws,
        centre: vec![0.0; 3],
        covariance: vec![vec![0.5, 0.1, 0.0], vec![0.1, 0.5, 0.0], vec![0.0, 0.0, 0.5]],
    };
    let of = |corner: Corner| Figure { corner: Some(corner), ..Figure::new("draws") };
    let svg = of(corner.clone()).to_svg().unwrap();
    assert!(roxmltree::Document::parse(&svg).is_ok());
    for name in ["tank.mass (kg)", "tank.length (m)", "a&lt;b (1)"] {
        assert!(svg.contains(name), "{name}");
    }
    // Three histograms with a normal curve each, three pairs with an ellipse each.
    assert!(svg.matches("<polyline").count() >= 9, "{}", svg.matches("<polyline").count());
    let mut broken = corner;
    broken.draws[1][7] = f64::NAN;
    assert!(matches!(of(broken).to_svg(), Err(ffid::exit::Failure::NotFinite { .. })));
}

/// Rows of intervals, correlations, and an area between curves: each is where its numbers are, and a number that is none is named.
#[test]
fn charts_are_drawn_and_refuse_what_is_not_finite() {
    let bar = |low, high| Interval { low, high, at: Some(0.5 * (low + high)), colour: 1, wide: false };
    let rows = vec![("base.mass".to_owned(), vec![bar(0.2, 0.4)]), ("far away".to_owned(), vec![bar(7.0, 9.0)])];
    let chart = Intervals { x_label: "deviations".into(), x_range: Some((-1.0, 1.0)), rows, ..Intervals::default() };
    let svg = Figure::new("intervals").intervals(chart.clone()).to_svg().unwrap();
    let doc = roxmltree::Document::parse(&svg).unwrap();
    let count = |tag: &str| doc.descendants().filter(|n| n.tag_name().name() == tag).count();
    // A dot for the one on the scale, an arrow for the other.
    assert_eq!(count("circle"), 1);
    assert!(svg.contains("base.mass") && svg.contains("deviations"));
    let mut bad = chart;
    bad.rows[1].1[0].high = f64::NAN;
    let Err(ffid::exit::Failure::NotFinite { place, .. }) = Figure::new("x").intervals(bad).to_svg() else { panic!() };
    assert!(place.contains("far away"), "{place}");

    let heat = Heat { names: vec!["k".into(), "d".into()], rows: vec![vec![1.0, -0.87], vec![-0.87, 1.0]] };
    assert!(Figure::new("heat").heat(heat).to_svg().unwrap().contains("\u{2212}.87"));

    let (x, low, high) = ([1.0, 2.0, 3.0], [0.1, 0.2, 0.1], [0.5, 0.9, 0.7]);
    let p = Panel::new("record", "fill").curve("truth", &x, &low).range(&x, &low, &high, 2);
    let drawn = Figure::new("area").panel(p.clone()).to_svg().unwrap();
    let json: serde_json::Value = serde_json::from_str(&Figure::new("area").panel(p).to_json(100)).unwrap();
    assert!(drawn.contains("<polygon") && json["panels"][0]["ranges"][0]["colour"] == 2);
}

/// A legend or title that is too long for its row goes on in the next, on a desk and on a phone: every text of a chart ends inside it.
#[test]
fn nothing_of_a_chart_is_wider_than_the_chart() {
    let kinds = [
        "noise",
        "masses",
        "joint placements",
        "centres of mass",
        "torque gains",
        "gyro misalignment",
        "encoder offsets",
    ];
    let bar =
        |k: usize| Interval { low: 10.0 * k as f64, high: 10.0 * (k + 1) as f64, at: None, colour: k, wide: true };
    let chart = Intervals {
        x_label: "distance from what was known before, in its standard deviations".into(),
        legend: kinds.iter().enumerate().map(|(k, n)| ((*n).to_owned(), k)).collect(),
        rows: vec![("a body with a long name.inertia".into(), (0..kinds.len()).map(bar).collect())],
        ..Intervals::default()
    };
    let f = Figure::new("Where the variance of each estimate comes from")
        .intervals(chart)
        .caption("Said at some length below it all.");
    for (svg, width) in [(f.to_svg().unwrap(), WIDTH), (f.to_narrow_svg().unwrap().unwrap(), 380.0)] {
        let doc = roxmltree::Document::parse(&svg).unwrap();
        let number = |n: &roxmltree::Node<'_, '_>, a: &str| n.attribute(a).unwrap().parse::<f64>().unwrap() / 8.0;
        let texts: Vec<_> = doc.descendants().filter(|n| n.tag_name().name() == "text").collect();
        for k in kinds {
            assert!(texts.iter().any(|t| t.text().is_some_and(|s| s.trim() == k)), "{k} at {width}");
        }
        for t in texts {
            let (long, x) =
                (layout::text_width(t.text().unwrap().trim(), number(&t, "font-size") * 0.97), number(&t, "x"));
            let (left, right) = match t.attribute("text-anchor") {
                Some("middle") => (x - 0.5 * long, x + 0.5 * long),
                Some("end") => (x - long, x),
                _ => (x, x + long),
            };
            assert!(left > -4.0 && right < width + 4.0, "{:?} from {left} to {right} of {width}", t.text());
        }
    }
    // Panels take the room of a desk.
    assert_eq!(spectrum().to_narrow_svg().unwrap(), None);
}

/// A curve upon another would hide it: dashed, both are seen.
#[test]
fn a_curve_upon_an_earlier_one_is_dashed() {
    let x: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.1).collect();
    let y: Vec<f64> = x.iter().map(|x| (0.7 * x).sin()).collect();
    let near: Vec<f64> = y.iter().map(|y| y + 1e-3).collect();
    let far: Vec<f64> = y.iter().map(|y| y + 0.1).collect();
    let of = |third: &[f64]| {
        let p = Panel::new("time (s)", "rate (rad/s)")
            .curve("first", &x, &y)
            .curve("other", &x, &far)
            .curve("third", &x, third);
        let json: serde_json::Value = serde_json::from_str(&Figure::new("").panel(p.clone()).to_json(1000)).unwrap();
        let dashed: Vec<bool> = (0..3).map(|k| json["panels"][0]["series"][k]["dashed"].as_bool().unwrap()).collect();
        (dashed, Figure::new("").panel(p).to_svg().unwrap().matches("<polyline").count())
    };
    let ((same, pieces), (apart, whole)) = (of(&near), of(&x));
    assert_eq!((same, apart), (vec![false, false, true], vec![false; 3]));
    assert!(pieces > whole + 10, "{pieces} and {whole} polylines");
}
