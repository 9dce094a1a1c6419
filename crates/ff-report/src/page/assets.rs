//! Scripts and styles that a page takes with it. Those of others are in `assets/vendor` with origin, licence and recipe.

use super::block::Block;

/// What a browser may do with a page: run what is in it, ask nobody for anything.
pub(super) const POLICY: &str =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";

const UPLOT: &str = include_str!("../../assets/vendor/uplot.min.js");
const UPLOT_STYLE: &str = include_str!("../../assets/vendor/uplot.min.css");
const OGL: &str = include_str!("../../assets/vendor/ogl.min.js");

const PLOTS: [&str; 2] = [UPLOT, include_str!("../../assets/plots/plots.js")];
const REPLAY: [&str; 5] = [
    OGL,
    include_str!("../../assets/replay/data.js"),
    include_str!("../../assets/replay/draw.js"),
    include_str!("../../assets/replay/robot.js"),
    include_str!("../../assets/replay/viewer.js"),
];
const PLOTS_STYLE: [&str; 2] = [UPLOT_STYLE, include_str!("../../assets/plots/plots.css")];
const REPLAY_STYLE: [&str; 1] = [include_str!("../../assets/replay/replay.css")];

/// What the blocks of a page need.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Needs {
    plots: bool,
    replay: bool,
}

impl Needs {
    pub(super) fn of<'a>(blocks: impl IntoIterator<Item = &'a Block>) -> Self {
        blocks.into_iter().fold(Self::default(), |n, b| {
            let own = match b {
                Block::Figure { .. } => Self { plots: true, replay: false },
                Block::Replay(_) => Self { plots: false, replay: true },
                Block::Details(_, inside) => Self::of(inside),
                _ => Self::default(),
            };
            Self { plots: n.plots || own.plots, replay: n.replay || own.replay }
        })
    }
    /// Scripts, in the order in which they run.
    pub(super) fn scripts(self) -> Vec<&'static str> {
        self.choose(&PLOTS, &REPLAY)
    }
    pub(super) fn styles(self) -> Vec<&'static str> {
        self.choose(&PLOTS_STYLE, &REPLAY_STYLE)
    }
    fn choose(self, plots: &[&'static str], replay: &[&'static str]) -> Vec<&'static str> {
        let plots = if self.plots { plots } else { &[] };
        let replay = if self.replay { replay } else { &[] };
        [plots, replay].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A script that held its own end tag would end there; the page's policy would not see it.
    #[test]
    fn no_script_ends_itself() {
        for text in PLOTS.iter().chain(&REPLAY).chain(&PLOTS_STYLE).chain(&REPLAY_STYLE) {
            let low = text.to_lowercase();
            assert!(!low.contains("</script") && !low.contains("<!--") && !low.contains("</style"));
        }
    }
}
