//! `report.html` of the study: the paper's tables beside ours, figures, every identification. One file, offline.

use super::{Summary, checks, printed};
use ff_report::page::{Block, Level, Page};
use ff_report::plot::Figure;
use ffid::exit::Failure;

/// The page.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub(super) fn page(s: &Summary, panels: &[Figure], fuel: &[Figure]) -> Result<String, Failure> {
    let mut page = Page::new("The paper's section III, reproduced");
    let outside = checks::outside(s);
    let mut verdict = vec![if outside.is_empty() {
        "Every figure of the study is within its limit.".to_owned()
    } else {
        format!("{} figures of the study are OUTSIDE their limits.", outside.len())
    }];
    verdict.extend(outside.iter().cloned());
    if s.quick {
        verdict.push("This is a quick run: shorter trajectories, fewer parameters, looser limits.".to_owned());
    }
    page.verdict(if outside.is_empty() { Level::Good } else { Level::Bad }, &verdict);
    let [two, three, frequencies] = printed::tables(s);
    let figures = |all: &[Figure]| all.iter().map(|f| Block::figure(f, 2000)).collect::<Result<Vec<_>, _>>();
    let mut blocks = two.blocks();
    blocks.extend(figures(panels)?);
    page.section("Flexible panels", blocks);
    let mut blocks = three.blocks();
    blocks.extend(figures(fuel)?);
    page.section("Fuel slosh", blocks);
    page.section("Natural frequencies", frequencies.blocks());
    page.section("Identifications", vec![Block::List(s.identified.iter().map(|r| r.line()).collect())]);
    Ok(page.render())
}
