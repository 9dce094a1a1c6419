//! From samples to the shortest polyline that looks the same.

/// A point in pixels.
pub(super) type Point = (f64, f64);

/// Rectangle of the data area in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Frame {
    fn holds(&self, p: Point) -> bool {
        p.0 >= self.left && p.0 <= self.right && p.1 >= self.top && p.1 <= self.bottom
    }
}

/// Runs of points, broken where a sample has no pixel, clipped, decimated and simplified.
pub(super) fn visible(points: impl Iterator<Item = Option<Point>>, frame: &Frame) -> Vec<Vec<Point>> {
    let mut runs: Vec<Vec<Point>> = vec![Vec::new()];
    for p in points {
        match (p, runs.last_mut()) {
            (Some(p), Some(run)) => run.push(p),
            (None, Some(run)) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs.iter()
        .flat_map(|run| clip(&per_column(run), frame))
        .map(|run| simplify(&run, 0.2))
        .filter(|run| run.len() > 1)
        .collect()
}

/// First, least, greatest and last sample of every pixel column, in order of occurrence.
fn per_column(run: &[Point]) -> Vec<Point> {
    let mut out = Vec::new();
    let mut start = 0;
    while start < run.len() {
        let column = run[start].0.floor();
        let len = run[start..].iter().take_while(|p| p.0.floor() == column).count().max(1);
        let group = &run[start..start + len];
        let by = |better: fn(f64, f64) -> bool| {
            (1..len).fold(0, |best, i| if better(group[i].1, group[best].1) { i } else { best })
        };
        let mut keep = [0, by(|a, b| a < b), by(|a, b| a > b), len - 1];
        keep.sort_unstable();
        for (k, &i) in keep.iter().enumerate() {
            if k == 0 || keep[k - 1] != i {
                out.push(group[i]);
            }
        }
        start += len;
    }
    out
}

/// The parts of a polyline inside the frame (Liang and Barsky, segment by segment).
fn clip(run: &[Point], f: &Frame) -> Vec<Vec<Point>> {
    let mut out: Vec<Vec<Point>> = Vec::new();
    let mut open = false;
    for pair in run.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let Some((p, q)) = clip_segment(a, b, f) else {
            open = false;
            continue;
        };
        match out.last_mut() {
            Some(last) if open => last.push(q),
            _ => out.push(vec![p, q]),
        }
        open = f.holds(b);
    }
    out
}

fn clip_segment(a: Point, b: Point, f: &Frame) -> Option<(Point, Point)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
    for (p, q) in [(-dx, a.0 - f.left), (dx, f.right - a.0), (-dy, a.1 - f.top), (dy, f.bottom - a.1)] {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            t0 = t0.max(q / p);
        } else {
            t1 = t1.min(q / p);
        }
    }
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    (t0 <= t1).then(|| (at(t0), at(t1)))
}

/// Drops points that lie within `tol` pixels of the line through their neighbours (Douglas-Peucker).
fn simplify(run: &[Point], tol: f64) -> Vec<Point> {
    if run.len() < 3 {
        return run.to_vec();
    }
    let mut keep = vec![false; run.len()];
    keep[0] = true;
    keep[run.len() - 1] = true;
    let mut todo = vec![(0, run.len() - 1)];
    while let Some((i, j)) = todo.pop() {
        let (a, b) = (run[i], run[j]);
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length = dx.hypot(dy);
        let distance = |p: Point| {
            if length > 0.0 {
                ((p.0 - a.0) * dy - (p.1 - a.1) * dx).abs() / length
            } else {
                (p.0 - a.0).hypot(p.1 - a.1)
            }
        };
        let far = (i + 1..j).map(|k| (k, distance(run[k]))).fold((i, 0.0), |m, c| if c.1 > m.1 { c } else { m });
        if far.1 > tol {
            keep[far.0] = true;
            todo.push((i, far.0));
            todo.push((far.0, j));
        }
    }
    run.iter().zip(&keep).filter(|(_, k)| **k).map(|(p, _)| *p).collect()
}

/// Cuts a polyline into dashes of `on` pixels with gaps of `off` pixels.
pub(super) fn dashes(run: &[Point], on: f64, off: f64) -> Vec<Vec<Point>> {
    let mut out: Vec<Vec<Point>> = Vec::new();
    let mut drawing = true;
    let mut left = on;
    let mut current: Vec<Point> = run.first().copied().into_iter().collect();
    for pair in run.windows(2) {
        let (mut a, b) = (pair[0], pair[1]);
        loop {
            let rest = (b.0 - a.0).hypot(b.1 - a.1);
            if rest <= left {
                left -= rest;
                current.push(b);
                break;
            }
            let t = left / rest;
            a = (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
            current.push(a);
            if drawing {
                out.push(std::mem::take(&mut current));
            }
            current = vec![a];
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
    }
    if drawing && current.len() > 1 {
        out.push(current);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Frame = Frame { left: 0.0, top: 0.0, right: 100.0, bottom: 50.0 };

    #[test]
    fn a_long_record_keeps_its_peaks_and_loses_its_bulk() {
        let n = 1_000_000;
        let spike = 654_321;
        let pts = (0..n).map(|i| {
            let y = if i == spike { 3.0 } else { 25.0 + 10.0 * (i as f64 * 1e-5).sin() };
            Some((i as f64 / n as f64 * 100.0, y))
        });
        let runs = visible(pts, &FRAME);
        assert_eq!(runs.len(), 1);
        assert!(runs[0].len() < 400, "{} points", runs[0].len());
        assert!(runs[0].iter().any(|p| p.1 == 3.0), "the spike is gone");
    }

    #[test]
    fn curves_are_cut_at_the_frame_and_at_gaps() {
        let up_and_out = [(10.0, 25.0), (20.0, -25.0), (30.0, 25.0)].map(Some);
        let runs = visible(up_and_out.into_iter(), &FRAME);
        assert_eq!(runs, [vec![(10.0, 25.0), (15.0, 0.0)], vec![(25.0, 0.0), (30.0, 25.0)]]);
        let gap = [Some((1.0, 1.0)), Some((5.0, 9.0)), None, Some((7.0, 7.0)), Some((9.0, 1.0))];
        assert_eq!(visible(gap.into_iter(), &FRAME).len(), 2);
    }

    #[test]
    fn dashes_cover_the_right_share() {
        let total: f64 = dashes(&[(0.0, 0.0), (100.0, 0.0)], 6.0, 4.0).iter().map(|d| d[d.len() - 1].0 - d[0].0).sum();
        assert!((total - 60.0).abs() < 1e-9, "{total}");
    }
}
