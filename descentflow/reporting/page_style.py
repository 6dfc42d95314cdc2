"""The style sheet of every HTML page: wide and narrow screens, light and dark, and paper."""

STYLE = """
:root { color-scheme: light dark; --ground: #fff; --text: #1f2328; --muted: #5c646d; --line: #d4d8dd;
  --faint: #e9ebee; --box: #f3f6fa; --link: #005f9e; --note: #0072b2; --good: #00695c; --bad: #b3261e;
  --warn: #c45100; }
@media screen and (prefers-color-scheme: dark) { :root { --ground: #16191d; --text: #e3e6ea; --muted: #a2abb5;
  --line: #424a53; --faint: #2b3138; --box: #20262d; --link: #7cc0f5; --note: #4ea3e0; --good: #5fc9b4; --bad: #ff8f85;
  --warn: #f0954a; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; scroll-behavior: auto; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 74rem; margin: 2rem auto 4rem; padding: 0 1.2rem;
  background: var(--ground); color: var(--text); overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.25rem; line-height: 1.3; margin: 2.6rem 0 .8rem; padding-bottom: .25rem;
  border-bottom: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .3rem; }
p, ul, .box { max-width: 50rem; } p { margin: .7rem 0; } li { margin: .3rem 0; }
a { color: var(--link); } .lead { font-size: 1.08rem; } .note { color: var(--muted); font-size: .92rem; }
.box { background: var(--box); border-left: .4rem solid var(--note); padding: .8rem 1.2rem; margin: 1rem 0;
  font-size: 1.08rem; }
.box.good { border-color: var(--good); } .box.bad { border-color: var(--bad); } .box.warn { border-color: var(--warn); }
.box p { margin: .35rem 0; max-width: none; }
nav ul { columns: 16rem auto; padding: 0; margin: 1.2rem 0; max-width: none; list-style: none; font-size: .92rem; }
nav li { margin: 0; padding: .1rem 0; break-inside: avoid; } nav a { text-decoration: none; }
nav a:hover, nav a:focus { text-decoration: underline; }
figure { margin: 1.2rem 0; } figcaption { color: var(--muted); font-size: .88rem; max-width: 50rem; margin-top: .3rem; }
img { display: block; max-width: 100%; height: auto; background: #fff; border-radius: 2px; }
.drawing svg { display: block; width: 100%; height: auto; border-radius: 2px; stroke-linejoin: round; }
.drawing.narrow { display: none; }
.scroll, .stack { overflow-x: auto; }
table { border-collapse: separate; border-spacing: 0; font-size: .86rem; line-height: 1.4; margin: .8rem 0;
  font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--muted); padding-bottom: .3rem; }
td, th { padding: .2rem .65rem; text-align: left; vertical-align: top; }
tbody td { border-top: 1px solid var(--faint); } tbody tr:first-child td { border-top: 0; }
tbody tr:last-child td { border-bottom: 1px solid var(--faint); }
td:first-child, th:first-child { padding-left: 0; }
thead th { border-bottom: 1px solid var(--muted); vertical-align: bottom; font-weight: 600; }
tbody tr.group td { border-top-color: var(--muted); }
td.again { visibility: hidden; }
.r { text-align: right; } td.r { white-space: nowrap; }
small { display: block; color: var(--muted); font-weight: 400; font-size: .9em; }
.best { font-weight: 700; } .reference { color: var(--muted); }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
.box.good, .box.bad { color: inherit; font-weight: inherit; }
code, pre { font: .88em/1.45 ui-monospace, monospace; } code { overflow-wrap: anywhere; } pre { overflow-x: auto; }
summary { cursor: pointer; margin: .6rem 0; color: var(--link); }
@media screen and (max-width: 56rem) {
  .drawing.wide { display: none; } .drawing.narrow { display: block; }
}
@media screen and (max-width: 40rem) {
  body { margin-top: 1rem; padding: 0 .9rem; } h1 { font-size: 1.4rem; }
  .box { padding: .6rem .9rem; font-size: 1rem; }
  table { width: max-content; font-size: .8rem; } td { max-width: 17rem; } th { max-width: 7rem; }
  td, th { padding: .2rem .4rem; }
  figure .scroll img { max-width: 46rem; }
  td:first-child, th:first-child { position: sticky; left: 0; background: var(--ground); max-width: 9rem;
    border-right: 1px solid var(--faint); }
  td.again { visibility: visible; color: var(--muted); }
  .stack table, .stack tbody, .stack tr, .stack td, .stack td:first-child { display: block; width: auto;
    max-width: none; position: static; border-right: 0; text-align: left; white-space: normal; }
  .stack caption { display: block; }
  .stack thead { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  .stack tbody tr { border-top: 1px solid var(--line); padding: .3rem 0; }
  .stack td, .stack tbody tr:last-child td { border: 0; padding: .05rem 0; font-size: .85rem; }
  .stack td:first-child { font-weight: 600; }
  .stack td[data-name]::before { content: attr(data-name) ": "; color: var(--muted); }
}
@media print {
  :root { color-scheme: light; } html { font-size: 10pt; }
  body { max-width: none; margin: 0; padding: 0; font-size: 1rem; }
  p, ul, .box, figcaption { max-width: none; } a { color: inherit; text-decoration: none; } nav { display: none; }
  h1, h2, h3, caption, summary { break-after: avoid; } thead { display: table-header-group; }
  tr, figure, .box { break-inside: avoid; } img { max-height: 21cm; width: auto; }
  .drawing svg { max-height: 21cm; } .drawing { print-color-adjust: exact; }
  table { font-size: 8pt; } td, th { padding: .1rem .4rem; } .scroll, pre { overflow: visible; }
  pre { white-space: pre-wrap; }
  details::details-content { content-visibility: visible; display: block; block-size: auto; opacity: 1; }
  .landscape table { font-size: 7.5pt; } .landscape img { max-height: 14.2cm; }
}
@page { size: A4; margin: 13mm; }
"""

LANDSCAPE = "@page { size: A4 landscape; margin: 11mm; }\n"
"""For pages of wide tables: on paper they lie across."""
