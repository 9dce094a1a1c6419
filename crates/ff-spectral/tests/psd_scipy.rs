//! Welch spectra against `scipy.signal.welch`; `data/make_welch.py` made the numbers.

use ff_spectral::Welch;
use ff_testkit::assert_within;
use serde_json::Value;

#[test]
fn agrees_with_scipy_for_even_odd_and_whole_record_segments() {
    let numbers = |v: &Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let doc: Value = serde_json::from_str(include_str!("data/welch.json")).unwrap();
    let n = doc["samples"].as_u64().unwrap();
    let x: Vec<f64> =
        (0..n).map(|i| ((i * 7919 + 13) % 1009) as f64 / 1009.0 - 0.37 + ((i * i) % 97) as f64 / 53.0).collect();
    let mut worst = 0.0f64;
    for case in doc["cases"].as_array().unwrap() {
        let segment = case["segment"].as_u64().unwrap() as usize;
        let p = Welch::new(segment, doc["rate_hz"].as_f64().unwrap()).unwrap().run(&x).unwrap();
        let (f, d) = (numbers(&case["frequency"]), numbers(&case["density"]));
        assert_eq!(p.density.len(), d.len());
        let top = d.iter().cloned().fold(0.0, f64::max);
        for j in 0..d.len() {
            assert_within!((p.frequency[j] - f[j]).abs(), 1e-12 * f[f.len() - 1]);
            // The bin at zero holds only rounding noise: judge it against the top of the spectrum.
            worst = worst.max((p.density[j] - d[j]).abs() / d[j].max(1e-3 * top));
        }
    }
    println!("worst relative difference {worst:.2e}");
    assert_within!(worst, 1e-12, "{worst:.3e}");
}

/// Zeros after the window put lines between those that were there, and leave these and the power as they are.
#[test]
fn padding_adds_lines_between_the_lines() {
    for n in [120, 121] {
        let x: Vec<f64> = (0..n).map(|i| (0.31 * f64::from(i)).sin() + 0.01 * f64::from(i * i % 7)).collect();
        let plain = Welch::new(60, 10.0).unwrap().run(&x).unwrap();
        let padded = Welch::new(60, 10.0).unwrap().padded(8).run(&x).unwrap();
        assert_eq!((padded.segments, padded.segment, padded.df * 8.0), (plain.segments, plain.segment, plain.df));
        let top = plain.density.iter().copied().fold(0.0, f64::max);
        for (j, d) in plain.density.iter().enumerate() {
            assert_within!((padded.density[8 * j] - d).abs(), 1e-12 * top);
            assert_within!((padded.frequency[8 * j] - plain.frequency[j]).abs(), 1e-12);
        }
        let power = |p: &ff_spectral::Psd| p.density.iter().sum::<f64>() * p.df;
        assert_within!((power(&padded) / power(&plain) - 1.0).abs(), 1e-12);
    }
}
