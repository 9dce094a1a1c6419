//! The page of a replay: view, controls, and tables that need neither script nor WebGL.

use super::{Replay, Scene};
use crate::page::{Block, Cell, Page, Table, escape, script_json};
use ffid::exit::Failure;
use ffid::workflow::identify::num;

/// The view and its controls. Labels are for readers of screens as well.
const VIEW: &str = "\
<div class=\"stage\"><canvas tabindex=\"0\" role=\"img\" aria-label=\"3-D view of the robot. Space plays, arrow keys step, 1 to 4 place the camera; drag to turn, \
scroll to zoom.\"></canvas><div class=\"labels\" aria-hidden=\"true\"></div></div>
<p class=\"failed\">The 3-D view needs scripts and WebGL; the tables below do not.</p>
<div class=\"bar\"><button type=\"button\" data-control=\"play\" aria-pressed=\"false\">Play</button>
<label class=\"time\">time <input type=\"range\" data-control=\"time\" min=\"0\" max=\"1\" step=\"0.01\" value=\"0\"/></label><output data-control=\"clock\">0 s</output>
<label>speed <select data-control=\"speed\"><option value=\"0.1\">×0.1</option><option value=\"0.5\">×0.5</option><option value=\"1\" selected=\"selected\">×1</option>\
<option value=\"4\">×4</option><option value=\"16\">×16</option></select></label>
<label>show <select data-control=\"what\"></select></label></div>
<div class=\"bar\"><label>deflections <input type=\"range\" data-control=\"deflection\" min=\"1\" max=\"50\" step=\"1\" value=\"1\"/></label><output data-control=\"deflection-value\">×1</output>
<label>ellipsoid <select data-control=\"ellipsoid\"><option value=\"1\">1 σ</option><option value=\"10\">10 σ</option><option value=\"100\">100 σ</option></select></label><output \
data-control=\"ellipsoid-value\" hidden=\"hidden\">×1</output>
<label>robots <select data-control=\"beside\"><option value=\"over\">overlaid</option><option value=\"side\">side by side</option><option value=\"first\">the first</option>\
<option value=\"second\">the others</option></select></label></div>
<div class=\"bar\"><label><input type=\"checkbox\" data-control=\"names\"/> names</label>
<label><input type=\"checkbox\" data-control=\"boxes\"/> inertia as boxes</label>
<label><input type=\"checkbox\" data-control=\"sensors\" checked=\"checked\"/> sensors and mounts</label>
<label><input type=\"checkbox\" data-control=\"trail\" checked=\"checked\"/> trail of the base</label>
<label><input type=\"checkbox\" data-control=\"com\" checked=\"checked\"/> centre of mass</label>
<span><button type=\"button\" data-view=\"corner\">corner</button> <button type=\"button\" data-view=\"front\">front</button> \
<button type=\"button\" data-view=\"side\">side</button> <button type=\"button\" data-view=\"top\">top</button></span>
<span>grid <output data-control=\"grid\">1 m</output></span></div>
<div class=\"bar key\"><span><i style=\"background:#7d8b99\"></i>links</span><span data-key=\"panel\"><i style=\"background:#0072b2\"></i>flexible structure</span>\
<span data-key=\"fuel\"><i style=\"background:#e69f00\"></i>fuel, rotors</span><span data-key=\"joint\"><i style=\"background:#cc79a7\"></i>joint sensors</span>\
<span>axes of gyro and mounts: <i style=\"background:#d55e00\"></i>x <i style=\"background:#009e73\"></i>y <i style=\"background:#0072b2\"></i>z</span>\
<span><i style=\"background:#d55e00;border-radius:50%\"></i>centre of mass</span><span data-key=\"trail\"><i style=\"background:#009e73\"></i>trail</span>";
/// Colours of the robots beside the first, taken in turn.
const GHOSTS: [&str; 3] = ["#56b4e9", "#c2a800", "#805e28"];

pub(super) fn render(r: &Replay) -> Result<String, Failure> {
    let json = serde_json::to_string(r).map_err(|e| Failure::Numerical(format!("replay '{}': {e}", r.title)))?;
    let mut page = Page::new(r.title.clone());
    page.source("Lengths in m, angles in rad. The data are in this file as JSON.");
    let first = r.scenes.first().map_or("", |s| s.label.as_str());
    let others: Vec<&str> = r.scenes.iter().skip(1).map(|s| s.label.as_str()).collect();
    page.lead(Block::text(match others.is_empty() {
        false => format!("Solid: {first}. Half transparent: {}.", others.join(", ")),
        true => format!("Shown: {first}."),
    }));
    page.lead(Block::Replay(format!(
        "<figure class=\"still\">{}</figure>{VIEW}{}</div><script type=\"application/json\">{}</script>",
        r.drawing(),
        key(&others),
        script_json(&json)
    )));
    page.section("Masses", vec![Block::Table(masses(&r.scenes))]);
    page.section("Natural modes, joints held", modes(&r.scenes));
    page.section("About this view", vec![Block::List(about(r))]);
    Ok(page.render())
}

/// Entries of the key for the robots beside the first; the script takes their colours from here.
fn key(others: &[&str]) -> String {
    let entry = |(label, colour): (&&str, &&str)| {
        format!("<span data-ghost=\"{colour}\"><i style=\"background:{colour}\"></i>{}</span>", escape(label))
    };
    others.iter().zip(GHOSTS.iter().cycle()).map(entry).collect()
}

fn masses(scenes: &[Scene]) -> Table {
    let row = |s: &Scene| {
        let mut cells = vec![Cell::words(s.label.clone()), Cell::number(num(s.mass_kg))];
        for k in 0..3 {
            let std = s.com_covariance_m2.map(|c| c[[0, 3, 5][k]].max(0.0).sqrt());
            let std = std.map_or_else(String::new, |x| format!(" ± {}", num(x)));
            cells.push(Cell::number(format!("{}{std}", num(s.com_m[k]))));
        }
        cells
    };
    Table {
        caption: "Everything, and its centre of mass in the base frame at the pose of the view without a motion".into(),
        head: ["robot", "mass (kg)", "x (m)", "y (m)", "z (m)"].map(String::from).to_vec(),
        rows: scenes.iter().map(row).collect(),
    }
}

fn modes(scenes: &[Scene]) -> Vec<Block> {
    let most = scenes.iter().map(|s| s.modes.len()).max().unwrap_or(0);
    if most == 0 {
        return Vec::new();
    }
    let row = |i: usize| {
        let mut cells = vec![Cell::words(format!("mode {}", i + 1))];
        for s in scenes {
            let mode = s.modes.get(i);
            cells.push(Cell::number(mode.map_or_else(String::new, |m| format!("{:.4}", m.frequency_hz))));
            cells.push(Cell::number(mode.map_or_else(String::new, |m| format!("{:.2}", 100.0 * m.damping_ratio))));
        }
        let moved = scenes[0].modes.get(i).map(|m| {
            let named = scenes[0].coordinates.iter().zip(&m.passive).filter(|(_, x)| x.abs() >= 0.3);
            named.map(|(n, x)| format!("{x:+.2} {n}")).collect::<Vec<_>>().join(", ")
        });
        cells.push(Cell::words(moved.unwrap_or_default()));
        cells
    };
    let heads = scenes.iter().flat_map(|s| [format!("{} (Hz)", s.label), "damping (%)".to_owned()]);
    let head = [String::new()].into_iter().chain(heads).chain(["shape".to_owned()]).collect();
    vec![Block::Table(Table { caption: "At the pose of the mission".into(), head, rows: (0..most).map(row).collect() })]
}

fn about(r: &Replay) -> Vec<String> {
    let mut out = vec![
        "A body without a surface of its own is drawn as the box of even density that has its mass, centre of mass and inertia (products of inertia below 2 % do not \
         turn it); a point mass as a ball of water of that mass. A panel is as long as from hinge to hinge."
            .to_owned(),
        "Deflections are multiplied about the relaxed springs; the base moves as it did.".to_owned(),
    ];
    if r.scenes.iter().any(|s| s.com_covariance_m2.is_some()) {
        out.push(
            "The ellipsoid about the centre of mass holds one (ten, a hundred) standard deviations along its axes."
                .to_owned(),
        );
    }
    out.extend(r.notes.iter().cloned());
    out
}
