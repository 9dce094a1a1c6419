use crate::workflow::identify::model_files::*;

fn fixture(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(path)
}

/// Values a little off the nominal ones, every digit used, bodies physical.
fn moved(model: &Model, selected: &[usize]) -> Vec<f64> {
    let mut v: Vec<f64> = model.param_decls().iter().map(|d| d.nominal).collect();
    for &i in selected {
        v[i] *= 1.0 + 0.012_345_678_901_234 / (1.0 + i as f64 / 7.0);
    }
    v
}

fn round_trip(mission: &Path) -> (Files, Vec<f64>, crate::open::Opened) {
    let opened = crate::open::open(mission, Leniency::default()).unwrap();
    let values = moved(&opened.model, &opened.estimated);
    let m = opened.mission.clone().unwrap();
    let (files, problems) =
        write(mission, &m, &opened.model, &values, &opened.estimated, &Leniency::default()).unwrap();
    assert_eq!(problems.0.len(), 0, "{problems}");
    (files, values, opened)
}

#[test]
fn every_mission_reloads_bit_for_bit_with_its_comments() {
    for file in ["paper/flex.toml", "paper/slosh.toml", "kinds/all.toml"] {
        let (files, values, opened) = round_trip(&fixture(file));
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in &files {
            std::fs::write(dir.path().join(name), bytes).unwrap();
        }
        let again = crate::open::open(&dir.path().join(TOML), Leniency::default()).unwrap();
        let nominal: Vec<f64> = again.model.param_decls().iter().map(|d| d.nominal).collect();
        assert_eq!(nominal, values, "{file}");
        assert_eq!(again.estimated, opened.estimated);
        let text = String::from_utf8(files[0].1.clone()).unwrap();
        let before = std::fs::read_to_string(fixture(file)).unwrap();
        let comments = |t: &str| t.lines().filter(|l| l.starts_with('#')).count();
        assert!(comments(&text) > comments(&before), "{file}: comments are kept");
        // Once more: the section that is there now is edited.
        let m = again.mission.clone().unwrap();
        let twice = moved(&again.model, &again.estimated);
        let (files, _) =
            write(&dir.path().join(TOML), &m, &again.model, &twice, &again.estimated, &Leniency::default()).unwrap();
        let text = String::from_utf8(files[0].1.clone()).unwrap();
        assert_eq!(text.matches("[parameters]").count(), 1, "{text}");
    }
}

#[test]
fn the_urdf_alone_is_the_same_robot_up_to_rounding() {
    let (files, values, opened) = round_trip(&fixture("paper/slosh.toml"));
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(URDF);
    std::fs::write(&path, &files[1].1).unwrap();
    let alone = crate::open::open(&path, Leniency::default()).unwrap();
    let body = Inertia::from_params(&values[..10]);
    for (i, (a, b)) in alone.model.inertia(0).to_params().iter().zip(body.to_params()).enumerate() {
        let size = [body.mass, body.rot.trace()][usize::from(i > 3)];
        assert!((a - b).abs() <= 1e-12 * size, "{i}: {a} {b}");
    }
    for i in 1..alone.model.n_bodies() {
        assert_eq!(alone.model.inertia(i), opened.model.inertia(i));
    }
}

#[test]
fn links_without_inertial_and_links_fixed_to_a_body_are_written() {
    let text = "<robot name=\"r\"><link name=\"hull\"><visual/></link><link name=\"box\"><inertial><mass value=\"2\"/>\
                <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
                <joint name=\"f\" type=\"fixed\"><parent link=\"hull\"/><child link=\"box\"/>\
                <origin xyz=\"0.3 -0.2 0.1\"/></joint><link name=\"lamp\"/></robot>";
    let hull = Inertia::from_com(5.0, &nalgebra::Vector3::new(0.1, 0.2, -0.3), &nalgebra::Matrix3::identity());
    let mut model = Model::new("r", "hull", hull, ff_model::BaseKind::Floating);
    model.add_frame("box", 0, ff_model::Xform::identity());
    model.add_frame("lamp", 0, ff_model::Xform::identity());
    let all: Vec<usize> = (0..10).collect();
    let out = urdf(text, &model, &hull.to_params(), &all).unwrap();
    let doc = roxmltree::Document::parse(&out).unwrap();
    let mass = |name: &str| {
        let link = doc.descendants().find(|n| n.has_tag_name("link") && n.attribute("name") == Some(name)).unwrap();
        let m = link.descendants().find(|n| n.has_tag_name("mass"))?;
        m.attribute("value").map(str::to_owned)
    };
    assert_eq!((mass("hull").as_deref(), mass("box").as_deref(), mass("lamp")), (Some("5"), Some("0"), None));
    let bare = urdf("<robot name=\"r\"><link name=\"hull\"/></robot>", &model, &hull.to_params(), &all).unwrap();
    assert!(bare.contains("<link name=\"hull\">") && bare.contains("</link>"), "{bare}");
}

#[test]
fn sections_in_forms_that_cannot_be_edited_are_printed_anew() {
    let given: BTreeMap<String, f64> = [("base.mass".to_owned(), 612.5)].into_iter().collect();
    let (none, files) = (BTreeMap::new(), BTreeMap::new());
    let inline = "parameters = { \"base.mass\" = 600 }\n[robot]\nurdf = \"a.urdf\"\n";
    let edited = edit(inline, (&given, &none), &files);
    // The value alone can be replaced in place, but new names have no section to go to.
    assert!(edited.is_none(), "{edited:?}");
    let out = printed(inline, (&given, &none), &files).unwrap();
    let t: toml::Table = out.parse().unwrap();
    assert_eq!(t["parameters"]["base.mass"].as_float(), Some(612.5));
    assert_eq!(t["robot"]["urdf"].as_str(), Some(URDF));
    assert_eq!(number(3.0), "3.0");
    assert_eq!(number(-1.25e-300), "-1.25e-300");
}

/// A fit of three of the ten numbers of a body: what was not estimated comes back from the URDF up to rounding only, and the mission
/// reloads to the same bits all the same.
#[test]
fn a_part_of_a_body_reloads_bit_for_bit() {
    let file = fixture("paper/slosh.toml");
    let opened = crate::open::open(&file, Leniency::default()).unwrap();
    let m = opened.mission.clone().unwrap();
    for some in [[0, 1, 4], [0, 3, 9], [1, 2, 6]] {
        let values = moved(&opened.model, &some);
        let (files, problems) = write(&file, &m, &opened.model, &values, &some, &Leniency::default()).unwrap();
        assert_eq!((files.len(), problems.0.len()), (2, 0), "{some:?}: {problems}");
    }
}

/// A link that breaks the triangle inequality reloads all the same, and the warning says which; where the base does, from which the mission would estimate it,
/// the files are written as well, and the warning says where the estimates are.
#[test]
fn bodies_that_cannot_exist_are_written_with_a_warning() {
    let file = fixture("paper/slosh.toml");
    let opened = crate::open::open(&file, Leniency::default()).unwrap();
    let m = opened.mission.clone().unwrap();
    let written = |izz: usize| {
        let mut values: Vec<f64> = opened.model.param_decls().iter().map(|d| d.nominal).collect();
        values[izz] *= 40.0; // i_zz beyond i_xx + i_yy
        let (files, problems) = write(&file, &m, &opened.model, &values, &[izz], &Leniency::default()).unwrap();
        assert_eq!(files.iter().map(|f| f.0.as_str()).collect::<Vec<_>>(), [TOML, URDF]);
        assert!(!problems.has_errors(), "{problems}");
        problems.0
    };
    let link = written(29);
    assert_eq!(link.iter().map(|p| p.code).collect::<Vec<_>>(), ["Fit::Impossible"], "{link:?}");
    assert_eq!(link[0].object.as_deref(), Some(opened.model.body_name(2)));
    let base = written(9);
    assert_eq!(base.iter().map(|p| p.code).collect::<Vec<_>>(), ["Fit::Reload", "Fit::Impossible"], "{base:?}");
    assert!(base[0].to_string().contains("result.json"), "{}", base[0]);
}
