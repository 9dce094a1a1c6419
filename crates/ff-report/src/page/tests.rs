use crate::page::*;
use crate::plot::{Figure, Panel};

/// A page with everything in it, and names that try to break out.
fn page() -> Page {
    let evil = "</title><script>alert(1)</script> & \"quotes\" 'n' \u{7}";
    let mut p = Page::new(evil);
    p.verdict(Level::Bad, &[evil.to_owned()]);
    let t: Vec<f64> = (0..50).map(f64::from).collect();
    let fig = Figure::new(evil).panel(Panel::new("time (s)", evil).curve(evil, &t, &t).vline(20.0, evil));
    let cells = vec![
        Cell::words(evil),
        Cell::number(evil),
        Cell::Mark(Level::Fair, evil.into()),
        interval(1.2, Some((1.0, 1.4)), Some((0.3, 2.2)), 0.9),
    ];
    let table = Table { caption: evil.into(), head: vec![evil.into(); 4], rows: vec![cells] };
    p.section(evil, vec![Block::text(evil), Block::List(vec![evil.into()]), Block::Table(table)]);
    p.section("figure", vec![Block::figure(&fig, 100).unwrap(), Block::Code(evil.into())]);
    p.section("more", vec![Block::Details(evil.into(), vec![Block::text(evil)])]);
    p.section("nothing", vec![]);
    p
}

#[test]
fn names_cannot_break_out_of_the_page() {
    let html = page().render();
    // Scripts are those of the page: the figure's data, uPlot, plots.js.
    assert_eq!(html.matches("<script").count(), 3);
    assert!(!html.contains("alert(1)</script>") && !html.contains('\u{7}'));
    assert!(html.contains("&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;quotes&quot; &#39;n&#39; \u{fffd}"));
    assert!(!html.contains("nothing"));
}

/// Scripts are not markup: what stands between their tags is left out.
fn without_scripts(html: &str) -> String {
    let mut parts = html.split("<script");
    let mut out = parts.next().unwrap().to_owned();
    for part in parts {
        out.push_str(part.split_once("</script>").unwrap().1);
    }
    out
}

#[test]
fn a_page_without_figures_has_no_script_and_wide_tables_say_what_their_cells_are() {
    let mut p = Page::new("plain");
    let row = ["k", "1", "2", "3"].map(Cell::words).to_vec();
    let head = ["name", "value & unit", "std", "prior"].map(String::from).to_vec();
    p.section("table", vec![Block::Table(Table { caption: String::new(), head, rows: vec![row] })]);
    let html = p.render();
    assert!(!html.contains("<script") && !html.contains("uPlot"));
    assert!(html.contains("<table class=\"cards\">") && html.contains("<td data-label=\"value &amp; unit\">1</td>"));
}

/// Every tag is closed in order: what is left after the void ones is well-formed XML.
#[test]
fn the_page_is_well_formed_and_needs_nothing_from_elsewhere() {
    let html = page().render();
    assert!(html.contains("content=\"default-src 'none';"));
    let xml = without_scripts(&html.replacen("<!doctype html>", "", 1));
    let doc = roxmltree::Document::parse(&xml).unwrap();
    assert!(doc.descendants().any(|n| n.has_tag_name("svg") || n.tag_name().name() == "svg"));
    let outside = doc
        .descendants()
        .flat_map(|n| n.attributes())
        .filter(|a| matches!(a.name(), "href" | "src") && !a.value().starts_with('#'))
        .count();
    assert_eq!(outside, 0);
    assert!(!html.contains("url(") && !html.contains("@import"));
    for rule in ["prefers-color-scheme:dark", "@media print", "max-width:40rem"] {
        assert!(html.contains(rule), "{rule}");
    }
}

#[test]
fn intervals_share_one_scale_and_need_something_to_draw() {
    let Cell::Drawing(svg) = interval(2.0, Some((1.0, 3.0)), Some((0.0, 4.0)), 4.0) else { panic!("a drawing") };
    // 0 at 4 px, 4 at 140 px: the estimate from 38 to 106, its value in the middle.
    assert!(svg.contains("M4.0 9H140.0") && svg.contains("M38.0 9H106.0") && svg.contains("cx=\"72.0\""), "{svg}");
    assert_eq!(interval(2.0, None, None, 1.0), Cell::Words(String::new()));
    assert_eq!(interval(2.0, Some((2.0, 2.0)), None, 2.0), Cell::Words(String::new()));
}

/// A report says answer, trust and next step before anything else, and keeps every sentence.
#[test]
fn an_opening_comes_first_and_is_escaped() {
    let mut p = Page::new("opened");
    let part = |label, mark| Part { label, mark, sentences: vec!["mass <5> kg".into()] };
    p.open_with(Opening {
        level: Level::Fair,
        parts: vec![part("Answer", None), part("Trust", Some((Level::Bad, "none"))), part("Next step", None)],
        full: vec!["all & everything".into()],
    });
    p.section("later", vec![Block::text("x")]);
    let html = p.render();
    let at = |s: &str| html.find(s).unwrap_or_else(|| panic!("no {s}"));
    assert!(
        at("Answer</h2>") < at("Trust</h2>")
            && at("Trust</h2>") < at("Next step</h2>")
            && at("Next step</h2>") < at("later")
    );
    assert!(
        html.contains("mass &lt;5&gt; kg")
            && html.contains("all &amp; everything")
            && html.contains("class=\"mark bad\"")
    );
    roxmltree::Document::parse(&html.replacen("<!doctype html>", "", 1)).unwrap();
}

/// A number and its interval are too wide for a column of many: the interval stands below.
#[test]
fn an_interval_stands_below_its_number() {
    let mut p = Page::new("intervals");
    let row = vec![Cell::words("gain"), Cell::number("796 [256, 2471]"), Cell::number("3.1")];
    let head = ["", "over trials", "one"].map(String::from).to_vec();
    p.section("table", vec![Block::Table(Table { caption: String::new(), head, rows: vec![row] })]);
    let html = p.render();
    assert!(html.contains("<span>796 <span class=\"range\">[256, 2471]</span></span></td>"), "{html}");
    assert!(html.contains("class=\"n\">3.1</td>"));
    roxmltree::Document::parse(&html.replacen("<!doctype html>", "", 1)).unwrap();
}

/// A chart is drawn for a desk and for a phone.
#[test]
fn a_chart_of_intervals_is_readable_on_a_phone() {
    use crate::plot::{Interval, Intervals};
    let bar = Interval { low: 0.2, high: 0.4, at: Some(0.3), colour: 0, wide: false };
    let rows = vec![("base.mass".to_owned(), vec![bar])];
    let fig = Figure::new("chart").intervals(Intervals { x_label: "deviations".into(), rows, ..Intervals::default() });
    let Block::Drawing { svg, .. } = Block::figure(&fig, 0).unwrap() else { panic!("a drawing") };
    let width = |class: &str| {
        let part = svg.split(&format!("<div class=\"{class}\">")).nth(1).unwrap();
        part.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap()
    };
    assert!(width("desk") > 900.0 && width("phone") < 400.0, "{} and {}", width("desk"), width("phone"));
}
