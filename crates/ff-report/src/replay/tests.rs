//! What a replay says of a robot, held against the dynamics.

use super::*;
use ff_dynamics::State;
use ff_dynamics::analysis::Centroidal;
use ff_dynamics::motion::{Hold, JointMotion};
use ff_model::spatial::so3::{exp_so3, quat_to_rot};
use ff_model::{Params, Xform};
use nalgebra::{DMatrix, Vector3, Vector4};
use serde_json::Value;

fn open(name: &str) -> ffid::open::Opened {
    let path = format!("{}/../../fixtures/{name}", env!("CARGO_MANIFEST_DIR"));
    ffid::open::open(path.as_ref(), ff_mission::Leniency::default()).unwrap()
}

fn subject<'a>(o: &'a ffid::open::Opened, p: &'a Params<f64>, pose: &'a [f64], a: &'a Appearance) -> Subject<'a> {
    Subject { label: "model", model: &o.model, params: p, pose, trace: None, known: None, appearance: a }
}

/// Poses of all nodes at coordinates `x`, as the page computes them.
fn poses(scene: &Scene, x: &[f64]) -> Vec<Xform<f64>> {
    let mut out: Vec<Xform<f64>> = Vec::new();
    for n in &scene.nodes {
        let [qx, qy, qz, qw] = n.place.r;
        let place = Xform::new(quat_to_rot(&Vector4::new(qw, qx, qy, qz)), Vector3::from(n.place.p));
        let own = match &n.moves {
            None => Xform::identity(),
            Some(Moves::Turn { axis, by, .. }) => {
                Xform::new(quat_to_rot(&exp_so3(&(Vector3::from(*axis) * x[*by]))), Vector3::zeros())
            }
            Some(Moves::Slide { axis, by, .. }) => {
                Xform::new(nalgebra::Matrix3::identity(), Vector3::from(*axis) * x[*by])
            }
            Some(Moves::Sway { first, shift, turn }) => {
                let rest = |c: usize| scene.rest[first + c - scene.joints.len()];
                let sum = |rows: &[[f64; 3]]| {
                    rows.iter()
                        .enumerate()
                        .map(|(c, r)| Vector3::from(*r) * (x[first + c] - rest(c)))
                        .sum::<Vector3<f64>>()
                };
                Xform::new(quat_to_rot(&exp_so3(&sum(turn))), sum(shift))
            }
        };
        let parent = n.parent.map_or_else(Xform::identity, |p| out[p]);
        out.push(parent * place * own);
    }
    out
}

/// Centres of the inertia boxes (and of points), weighted by their masses, are the centre of mass of the dynamics: every body, panel and
/// tank is where the model has it, bent and swung.
#[test]
fn what_is_drawn_has_the_centre_of_mass_of_the_model() {
    for (mission, bend) in [("paper/combined.toml", 0.2), ("kinds/all.toml", 1e-5)] {
        let o = open(mission);
        let (p, pose, a) = (Params::nominal(&o.model), o.pose(), Appearance::default());
        let scene = Scene::new(&subject(&o, &p, &pose, &a));
        let mut state = State::<f64>::zero(&o.model);
        for (k, q) in state.q.iter_mut().enumerate() {
            *q = 0.3 * (k as f64 + 1.0).sin();
        }
        state.eta.copy_from_slice(&scene.rest);
        // An inertia linearised by hand keeps its first moment while its momentum moves: nothing to compare.
        for a in o.model.appendages().iter().filter(|a| a.decl().galilean) {
            for k in a.coord_offset..a.coord_offset + a.dim() {
                state.eta[k] += bend * (2.0 * k as f64 + 0.7).cos();
            }
        }
        let x: Vec<f64> = state.q.iter().chain(&state.eta).copied().collect();
        let at = poses(&scene, &x);
        let (mut mass, mut sum) = (0.0, Vector3::zeros());
        for (n, x) in scene.nodes.iter().zip(&at) {
            let Some(m) = n.mass_kg else { continue };
            let centre =
                n.shapes.iter().find(|s| matches!(s.role, Role::Inertia | Role::Fuel)).or(n.shapes.first()).unwrap();
            mass += m;
            sum += m * x.point(&Vector3::from(centre.place.p));
        }
        let mut c = Centroidal::<f64>::new(&o.model);
        c.evaluate(&p, &state);
        assert!((mass / c.mass() - 1.0).abs() < 1e-12, "{mission}: {mass} kg");
        assert!((sum / mass - c.com()).norm() < 1e-9, "{mission}: {} {}", sum / mass, c.com());
    }
}

/// A box of even density with the edges of the page has the inertia of the body.
#[test]
fn a_box_has_the_inertia_of_its_body() {
    let i = nalgebra::Matrix3::new(3.1, 0.4, -0.2, 0.4, 2.6, 0.3, -0.2, 0.3, 4.0);
    let body = ff_model::Inertia::from_com(7.0, &Vector3::new(0.1, -0.3, 0.2), &i);
    let d = shapes::equivalent(&body, Role::Inertia).unwrap();
    let Form::Box { size: [a, b, c] } = d.form else { panic!("{:?}", d.form) };
    let [x, y, z, w] = d.place.r;
    let r = quat_to_rot(&Vector4::new(w, x, y, z));
    let own =
        nalgebra::Matrix3::from_diagonal(&Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b)) * (7.0 / 12.0);
    assert!((r * own * r.transpose() - i).norm() < 1e-12);
    assert_eq!(d.place.p, [0.1, -0.3, 0.2]);
}

/// The covariance of the centre of mass against differences: 5 % of the base's mass and 2 kg m of its first moment.
#[test]
fn the_ellipsoid_follows_from_the_covariance_of_the_parameters() {
    let o = open("paper/combined.toml");
    let (p, pose, a) = (Params::nominal(&o.model), o.pose(), Appearance::default());
    let names = ["base.mass".to_owned(), "base.h_y".to_owned(), "no.such".to_owned()];
    let rows = vec![vec![900.0, 0.0, 0.0], vec![0.0, 4.0, 0.0], vec![0.0, 0.0, 1.0]];
    let known = Knowledge::of(&o.model, &names, &rows).unwrap();
    assert_eq!(known.indices, [0, 2]);
    let scene = Scene::new(&Subject { known: Some(&known), ..subject(&o, &p, &pose, &a) });
    let moved = |index: usize, by: f64| {
        let mut values = p.values().to_vec();
        values[index] += by;
        let mut c = Centroidal::<f64>::new(&o.model);
        let mut state = State::zero(&o.model);
        state.q.copy_from_slice(&pose);
        state.eta.copy_from_slice(&scene.rest);
        c.evaluate(&Params::from_values(&o.model, values), &state);
        *c.com()
    };
    let slope = |index| (moved(index, 1e-3) - moved(index, -1e-3)) / 2e-3;
    let (m, h) = (slope(0), slope(2));
    let want = 900.0 * m * m.transpose() + 4.0 * h * h.transpose();
    let got = scene.com_covariance_m2.unwrap();
    for (k, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
        assert!((got[k] - want[(i, j)]).abs() < 1e-6 * want.norm(), "{got:?} {want}");
    }
    assert!(Knowledge::of(&o.model, &names[2..], &rows).is_none());
}

/// The data in the page are the motion, to single precision.
#[test]
fn a_page_holds_the_motion_and_asks_nobody() {
    let o = open("paper/combined.toml");
    let (p, pose, a) = (Params::nominal(&o.model), o.pose(), Appearance::default());
    let motion: Box<dyn JointMotion> = Box::new(Hold::new(pose.clone(), 2.0).unwrap());
    let mut start = State::zero(&o.model);
    start.q.copy_from_slice(&pose);
    start.eta[0] = 0.05;
    let options = ff_dynamics::SimOptions { duration_s: 2.0, step_s: 0.01, sample_s: 0.01 };
    let drive = ff_dynamics::Drive::Prescribed(&*motion);
    let trace = ff_dynamics::simulate(&o.model, &p, &start, &drive, &options).unwrap();
    let known = Knowledge { indices: vec![0], covariance: DMatrix::from_element(1, 1, 25.0) };
    let scene = Scene::new(&Subject { trace: Some(&trace), known: Some(&known), ..subject(&o, &p, &pose, &a) });
    assert_eq!(scene.modes.len(), o.model.np());
    let html = Replay::new("<probe>", vec![scene], a).render().unwrap();
    assert!(
        html.contains("&lt;probe&gt;")
            && html.contains("default-src 'none'")
            && !html.contains("http-equiv=\"refresh\"")
    );
    assert!(!html.contains(" src=\"") && !html.contains("<img") && html.len() < 300_000, "{} bytes", html.len());
    let json = html.split("<script type=\"application/json\">").nth(1).unwrap().split("</script>").next().unwrap();
    let v: Value = serde_json::from_str(json).unwrap();
    let m = &v["scenes"][0]["motion"];
    let columns = 7 + o.model.nj() + o.model.np() + 3;
    // 100 samples a second become 33.
    assert_eq!((&m["frames"], &m["columns"]), (&Value::from(67), &Value::from(columns)));
    use base64::Engine;
    let bytes = base64::engine::general_purpose::STANDARD.decode(m["data"].as_str().unwrap()).unwrap();
    let number = |frame: usize, column: usize| {
        let at = 4 * (frame * columns + column);
        f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()))
    };
    assert_eq!(bytes.len(), 4 * 67 * columns);
    assert!((number(20, 7 + o.model.nj()) - trace.eta[(60, 0)]).abs() < 1e-8);
    assert!((number(20, 6) - trace.att[(60, 0)]).abs() < 1e-6, "the scalar part of the quaternion is last");
    assert_eq!(m["ellipsoids"]["at"].as_array().unwrap().len(), 40);
}

/// Links of a URDF with a box, a mesh that is there and one that is not.
#[test]
fn meshes_are_read_where_they_can_be_and_named_where_not() {
    let dir = tempfile::tempdir().unwrap();
    let link = |name: &str, looks: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"2\"/><inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>{looks}</link>"
        )
    };
    let mesh = |tag: &str, file: &str| {
        format!(
            "<{tag}><origin xyz=\"0.1 0 0\"/><geometry><mesh filename=\"{file}\" scale=\"0.5 1 1\"/></geometry></{tag}>"
        )
    };
    let turn = |n: u32, parent: &str, child: &str| {
        format!(
            "<joint name=\"j{n}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"0 0 1\"/></joint>"
        )
    };
    let text = format!(
        "<robot name=\"r\">{}{}{}{}{}</robot>",
        link("bus", "<visual><geometry><box size=\"1 2 3\"/></geometry></visual>"),
        link("arm", &(mesh("visual", "package://r/arm.dae") + &mesh("collision", "package://r/arm.stl"))),
        link("tool", &mesh("visual", "gone.stl")),
        turn(1, "bus", "arm"),
        turn(2, "arm", "tool"),
    );
    let folder = dir.path().join("r/urdf");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("r.urdf");
    std::fs::write(&path, text).unwrap();
    std::fs::write(dir.path().join("r/arm.dae"), "<COLLADA/>").unwrap();
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    std::fs::write(dir.path().join("r/arm.stl"), stl).unwrap();
    let o = ffid::open::open(&path, ff_mission::Leniency::default()).unwrap();
    let a = Appearance::of_urdf(&path, &o.model).unwrap();
    let forms: Vec<Vec<&Form>> = (0..3).map(|i| a.of_body(i).map(|d| &d.form).collect()).collect();
    assert_eq!(forms[0], [&Form::Box { size: [1.0, 2.0, 3.0] }]);
    assert_eq!(forms[1], [&Form::Mesh { mesh: 0, scale: [0.5, 1.0, 1.0] }]);
    assert!(forms[2].is_empty());
    assert!(a.notes.iter().any(|n| n.contains("tool (gone.stl is not found)")), "{:?}", a.notes);
}

/// A drawing on paper shows every node where the page does, and names what is mounted.
#[test]
fn a_drawing_has_every_node_where_the_page_has_it() {
    for mission in ["paper/combined.toml", "kinds/all.toml"] {
        let o = open(mission);
        let (p, pose, a) = (Params::nominal(&o.model), o.pose(), Appearance::default());
        let scene = Scene::new(&subject(&o, &p, &pose, &a));
        let at: Vec<f64> = scene.pose.iter().chain(&scene.rest).copied().collect();
        let drawn = drawing::placed(&scene);
        let far = drawn.iter().zip(poses(&scene, &at)).map(|(own, page)| {
            let r = own.rotation.to_rotation_matrix();
            (own.translation.vector - page.pos).norm() + (r.matrix() - page.rot).norm()
        });
        assert!(far.fold(0.0, f64::max) < 1e-12, "{mission}");
        let svg = Replay::new("", vec![scene], a).drawing();
        let doc = roxmltree::Document::parse(&svg).unwrap();
        let of = |tag: &str| doc.descendants().filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", tag))).count();
        // Fuel is inside of what carries it: seen through, and after all faces.
        if let Some(ball) = svg.find("fill-opacity") {
            assert!(ball > svg.rfind("<polygon").unwrap());
        }
        let place = |n: &roxmltree::Node<'_, '_>, a: &str| n.attribute(a).unwrap().parse::<f64>().unwrap();
        let texts: Vec<(f64, f64)> = doc
            .descendants()
            .filter(|n| n.tag_name().name() == "text")
            .map(|n| (place(&n, "x"), place(&n, "y")))
            .collect();
        for (i, a) in texts.iter().enumerate() {
            for b in &texts[..i] {
                assert!((a.0 - b.0).abs() > 18.0 || (a.1 - b.1).abs() > 16.0, "names upon each other: {texts:?}");
            }
        }
        // Three faces of every box that is seen, and names of base and appendages.
        assert!(of("polygon") > 20 && of("text") == 1 + o.model.appendages().len(), "{mission}");
    }
}
