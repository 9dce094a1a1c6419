//! Figs. 2 and 3 as drawings: the pendulum that stands for fuel, and the forces on its mass.

use ff_report::page::Block;

/// Opens a drawing of 760 x 360 px with arrow heads in two colours.
const OPEN: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 760 360\" role=\"img\" font-family=\"DejaVu Sans, Verdana, sans-serif\" \
font-size=\"15\" fill=\"#222\"><defs><marker id=\"ID\" viewBox=\"0 0 10 10\" refX=\"9\" refY=\"5\" markerWidth=\"8\" markerHeight=\"8\" orient=\"auto-start-reverse\">\
<path d=\"M0 0L10 5L0 10z\" fill=\"#222\"/></marker></defs><rect width=\"760\" height=\"360\" fill=\"#fff\"/>";

fn open(id: &str, label: &str) -> String {
    OPEN.replace("ID", id).replace("role=", &format!("aria-label=\"{label}\" role="))
}

/// Fig. 2: base, fixed mass, pendulum with spring and damper.
pub(super) fn pendulum() -> Block {
    let svg = open("a2", "pendulum equivalent of sloshing fuel")
        + "<rect x=\"200\" y=\"50\" width=\"300\" height=\"280\" rx=\"60\" fill=\"none\" stroke=\"#555\" stroke-width=\"2\"/>\
<text x=\"520\" y=\"90\">tank, part of the base</text>\
<rect x=\"225\" y=\"268\" width=\"250\" height=\"40\" rx=\"14\" fill=\"#ccc\"/><text x=\"240\" y=\"294\">fixed fuel, part of the base</text>\
<path d=\"M350 100L426 232\" stroke=\"#0072b2\" stroke-width=\"4\"/><circle cx=\"350\" cy=\"100\" r=\"6\"/><text x=\"234\" y=\"98\">fulcrum r_f</text>\
<circle cx=\"426\" cy=\"232\" r=\"20\" fill=\"#e69f00\" stroke=\"#222\"/><text x=\"454\" y=\"240\">m_s</text>\
<path d=\"M350 100V250\" stroke=\"#555\" stroke-dasharray=\"6 4\"/><path d=\"M350 180A80 80 0 0 0 389 169\" fill=\"none\" stroke=\"#222\" marker-end=\"url(#a2)\"/>\
<text x=\"362\" y=\"206\">\u{3b1}</text><text x=\"400\" y=\"158\">l_s, without mass</text>\
<path d=\"M350 100m-26 14a30 30 0 0 0 40 14\" fill=\"none\" stroke=\"#d55e00\" stroke-width=\"3\"/>\
<text x=\"214\" y=\"134\" fill=\"#b34a00\">k_s, d_s</text>\
<path d=\"M70 200H150\" stroke=\"#222\" stroke-width=\"2\" marker-end=\"url(#a2)\"/><text x=\"92\" y=\"222\">lateral</text>\
<path d=\"M70 200V120\" stroke=\"#222\" stroke-width=\"2\" marker-end=\"url(#a2)\"/><text x=\"40\" y=\"112\">axial</text></svg>";
    let caption = "Fig. 2: fuel as a pendulum on a universal joint, with a spring and a damper about each of two axes. Fuel that does not move counts to the base.";
    Block::Drawing { svg, caption: caption.into() }
}

/// Fig. 3: forces on the mass, and what the base receives.
pub(super) fn free_body() -> Block {
    let svg = open("a3", "free-body diagram of the sloshing mass")
        + "<path d=\"M190 60L280 216\" stroke=\"#0072b2\" stroke-width=\"2\" stroke-dasharray=\"7 5\"/><circle cx=\"280\" cy=\"216\" r=\"24\" fill=\"#e69f00\" stroke=\"#222\"/>\
<path d=\"M280 216L225 121\" stroke=\"#222\" stroke-width=\"3\" marker-end=\"url(#a3)\"/><text x=\"232\" y=\"112\">tension T</text>\
<path d=\"M280 216L202 261\" stroke=\"#d55e00\" stroke-width=\"3\" marker-end=\"url(#a3)\"/><text x=\"40\" y=\"290\">(k \u{3b1} + d \u{3b1}\u{2032})/l, across the arm</text>\
<path d=\"M280 216H372\" stroke=\"#009e73\" stroke-width=\"3\" marker-end=\"url(#a3)\"/><text x=\"318\" y=\"206\">m a</text>\
<circle cx=\"190\" cy=\"60\" r=\"6\"/><text x=\"60\" y=\"54\">fulcrum</text>\
<text x=\"430\" y=\"70\" font-weight=\"bold\">The base receives, small angles:</text>\
<text x=\"430\" y=\"106\">lateral force \u{2212}m (x\u{2033} + l \u{3b1}\u{2033})</text><text x=\"430\" y=\"130\">= (k \u{3b1} + d \u{3b1}\u{2032})/l</text>\
<text x=\"430\" y=\"166\">couple k \u{3b1} + d \u{3b1}\u{2032}</text>\
<text x=\"430\" y=\"216\" font-weight=\"bold\">Printed, (14):</text><text x=\"430\" y=\"246\">m (x\u{2033} + l \u{3b1}\u{2033}) + d \u{3b1}\u{2032}/l</text><text x=\"430\" y=\"276\">no spring, no couple</text></svg>";
    let caption = "Fig. 3: free body of the sloshing mass, corrected (errata, items 14 and 15). x is the position of the fulcrum, \u{3b1} the swing.";
    Block::Drawing { svg, caption: caption.into() }
}
