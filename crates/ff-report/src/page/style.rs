//! The style sheet: light, dark, paper, phone.

/// CSS of every report.
pub(super) const CSS: &str = "\
:root{color-scheme:light dark;--ink:#1b1f24;--soft:#57606a;--line:#d0d7de;--back:#fff;--card:#f6f8fa;\
--good:#0a6b3d;--fair:#8a5a00;--bad:#b3261e;--prior:#b9c2cc;--est:#0072b2}\
@media (prefers-color-scheme:dark){:root{--ink:#e6edf3;--soft:#9aa4af;--line:#343b44;--back:#0f1318;--card:#181d24;\
--good:#58c48b;--fair:#e0ac4a;--bad:#ff8a80;--prior:#4a545f;--est:#58b4ee}\
figure svg{filter:invert(.92) hue-rotate(180deg)}}\
*{box-sizing:border-box}\
body{margin:0 auto;max-width:76rem;padding:1rem 1.25rem 3rem;background:var(--back);color:var(--ink);\
font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;overflow-wrap:break-word}\
h1{font-size:1.6rem;line-height:1.25;margin:.5rem 0 1rem}\
h2{font-size:1.2rem;margin:2.2rem 0 .6rem;padding-top:.6rem;border-top:1px solid var(--line)}\
a{color:var(--est)}nav{font-size:.9rem;margin:1rem 0}nav a{margin-right:1rem}\
.verdict{border-left:.35rem solid;background:var(--card);padding:.7rem 1rem;border-radius:.3rem}\
.verdict p{margin:.35rem 0}.verdict p:first-child{font-weight:600;font-size:1.08rem}\
.good{color:var(--good)}.fair{color:var(--fair)}.bad{color:var(--bad)}\
.verdict.good,.verdict.fair,.verdict.bad{border-color:currentColor}.verdict p{color:var(--ink)}\
.opening .part{display:grid;grid-template-columns:6.5rem 1fr;gap:.2rem 1rem;padding:.45rem 0;border-bottom:1px solid var(--line)}\
.opening h2{font-size:.95rem;margin:.35rem 0 0;padding:0;border:0;color:var(--soft)}.opening .part p:first-child{font-weight:600;font-size:1.05rem}\
.opening .part>div{min-width:0}.opening .part p{margin:.25rem 0;overflow-wrap:anywhere}.opening details p{font-weight:400;font-size:1rem}\
.verdict p.mark.good{color:var(--good)}.verdict p.mark.fair{color:var(--fair)}.verdict p.mark.bad{color:var(--bad)}\
.wide{overflow-x:auto;margin:.8rem 0}\
table{border-collapse:collapse;font-size:.9rem;min-width:100%}\
caption{text-align:left;color:var(--soft);padding:.2rem 0 .4rem}\
th,td{padding:.28rem .6rem;border-bottom:1px solid var(--line);text-align:left;vertical-align:middle;white-space:nowrap}\
thead th{white-space:normal;vertical-align:bottom;border-bottom:2px solid var(--line);color:var(--soft);font-weight:600}\
tbody th{font-weight:500}\
.n{text-align:right;font-variant-numeric:tabular-nums}\
td svg{display:block;width:9rem;height:1.1rem}td .range{display:block;font-size:.85em;color:var(--soft)}.phone{display:none}\
.prior{stroke:var(--prior)}.est{stroke:var(--est)}.dot{fill:var(--est)}.start{stroke:var(--soft)}\
figure{margin:1rem 0;overflow-x:auto}\
figure svg{display:block;width:100%;min-width:38rem;height:auto}\
figure.drawing svg{max-width:52rem}td.w{white-space:normal;min-width:15rem}\
figcaption{color:var(--soft);font-size:.9rem}\
pre{background:var(--card);padding:.7rem 1rem;overflow-x:auto;font-size:.85rem;border-radius:.3rem}\
details{margin:.6rem 0}summary{cursor:pointer;color:var(--est)}\
footer{margin-top:2.5rem;color:var(--soft);font-size:.85rem;border-top:1px solid var(--line);padding-top:.6rem}\
.plots{display:none}.live>.plots{display:block}.live>svg{display:none}\
@media (max-width:40rem){body{padding:.6rem .8rem 2rem;font-size:15px}h1{font-size:1.3rem}\
.opening .part{grid-template-columns:1fr;gap:0;padding:.25rem 0}.opening h2{margin:0;font-size:.85rem}.opening{padding:.3rem .7rem}\
.opening .part p{font-size:.87rem;line-height:1.35;margin:.15rem 0}.opening .part p:first-child{font-size:.98rem}\
td,th{white-space:normal}\
.cards,.cards caption,.cards tbody,.cards tr,.cards th,.cards td{display:block}.cards thead{display:none}\
.cards tr{border-bottom:2px solid var(--line);padding:.4rem 0}.cards tbody th{font-weight:700;border:0}\
.cards td{display:flex;justify-content:space-between;gap:1rem;border:0;padding:.1rem .6rem;text-align:right}\
.cards td:empty{display:none}.cards td::before{content:attr(data-label);color:var(--soft);text-align:left}\
figure svg{min-width:34rem}td.w{min-width:0}.desk{display:none}.phone{display:block}.phone svg{min-width:0}}\
@media (max-height:45rem){h1{margin:.2rem 0 .5rem}.opening .part{padding:.2rem 0}.opening .part p{margin:.1rem 0;line-height:1.35}}\
@media print{:root{--ink:#000;--soft:#333;--line:#bbb;--back:#fff;--card:#fff}body{max-width:none;font-size:10pt;padding:0}\
nav{display:none}h2{break-after:avoid}tr,.verdict{break-inside:avoid}figure,.wide{overflow:visible}\
figure svg{min-width:0;filter:none}.live>svg{display:block}.live>.plots{display:none}details>*{display:block}table{font-size:7.5pt}td svg{width:5rem}}\
";
