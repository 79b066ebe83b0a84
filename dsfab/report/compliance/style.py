"""How the report looks, on a screen and on A4 paper; RUNNING and FOOTER stand at the edges of printed pages."""

STYLE = """
:root { color-scheme: light; --ink: #1f2328; --soft: #5d6570; --line: #cfd4da; --band: #f3f5f7; --good: #1c6e42;
  --bad: #a8321a; --open: #8a5a00; --accent: #2054a8; }
* { box-sizing: border-box; }
html { background: #e9ebee; }
body { margin: 2rem auto; padding: 18mm 20mm; max-width: 210mm; background: #fff; color: var(--ink);
  font: 10pt/1.45 "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif;
  box-shadow: 0 1px 8px rgba(0, 0, 0, .14); font-variant-numeric: tabular-nums; }
header { border-top: 3px solid var(--accent); padding-top: 4mm; margin-bottom: 7mm; }
.over { margin: 0; color: var(--soft); font-size: 9pt; letter-spacing: .08em; text-transform: uppercase; }
h1 { margin: 0 0 4mm; font-size: 22pt; line-height: 1.15; font-weight: 600; letter-spacing: -.01em; }
dl { display: grid; grid-template-columns: repeat(4, auto); gap: 1.5mm 6mm; margin: 0;
  border-top: 1px solid var(--line); border-bottom: 1px solid var(--line); padding: 2.5mm 0; }
dt { color: var(--soft); font-size: 7.5pt; } dd { margin: 0; }
h2 { margin: 9mm 0 2.5mm; font-size: 13.5pt; line-height: 1.25; font-weight: 600; break-after: avoid; }
h2 .no { display: inline-block; min-width: 9mm; color: var(--accent); }
section:first-of-type h2 { margin-top: 0; }
p { margin: 0 0 2.5mm; } .lead { font-size: 11.5pt; line-height: 1.45; } .quiet, .note { color: var(--soft); }
.note { font-size: 8pt; margin: 1.2mm 0 0; } ul { margin: 0 0 2.5mm; padding-left: 5mm; } li { margin: 0 0 1mm; }
.banner { border-left: 4px solid var(--open); background: var(--band); padding: 3mm 4mm; margin: 0 0 4mm; }
.banner b { font-size: 13pt; color: var(--open); } .banner p { margin: .8mm 0 0; }
.banner.pass { border-color: var(--good); } .banner.fail { border-color: var(--bad); }
.banner.pass b, td.pass { color: var(--good); } .banner.fail b, td.fail { color: var(--bad); }
td.unknown { color: var(--open); } td.pass, td.fail, td.unknown { font-weight: 600; }
.table { margin: 3mm 0 4.5mm; overflow-x: auto; break-inside: avoid; }
table { border-collapse: collapse; width: 100%; font-size: 8.5pt; }
caption, figcaption { text-align: left; font-size: 8.5pt; color: var(--ink); padding: 0 0 1.5mm; }
figcaption { padding: 1.5mm 0 0; }
thead { display: table-header-group; } tr { break-inside: avoid; }
th, td { text-align: right; padding: .9mm 1.6mm; vertical-align: top; border-bottom: 1px solid var(--line); }
th { font-weight: 600; border-top: 1px solid var(--ink); border-bottom: 1px solid var(--ink); vertical-align: bottom; }
td { white-space: nowrap; } .left { text-align: left; white-space: normal; }
.strong td { background: var(--band); font-weight: 600; }
tbody tr:last-child td { border-bottom: 1px solid var(--ink); }
figure { margin: 3mm 0 4.5mm; break-inside: avoid; } img { display: block; width: 100%; height: auto; }
.across { display: grid; grid-template-columns: repeat(2, 1fr); gap: 0 6mm; } .across figure { width: auto !important; }
.missing { border: 1px solid var(--line); padding: 8mm; color: var(--soft); text-align: center; }
.scale { font-size: 8pt; margin: 1mm 0; } .scale p { margin: 0 0 .6mm; } .scale div { display: flex; }
.scale i { flex: 1; height: 3.2mm; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.scale .labels { justify-content: space-between; color: var(--soft); padding-top: .5mm; }
code { font: 8.5pt ui-monospace, Menlo, Consolas, "Liberation Mono", monospace; }
pre { font: 7.5pt/1.4 ui-monospace, Menlo, Consolas, "Liberation Mono", monospace; background: var(--band);
  padding: 3mm; white-space: pre-wrap; overflow-wrap: anywhere; margin: 0 0 4mm; }
footer { border-top: 1px solid var(--line); margin-top: 8mm; padding-top: 2mm; color: var(--soft); font-size: 8pt; }
@page { size: A4; margin: 20mm 18mm 18mm;
  @top-left { content: "RUNNING"; font: 7.5pt Helvetica, Arial, sans-serif; color: #5d6570; }
  @bottom-left { content: "FOOTER"; font: 7.5pt Helvetica, Arial, sans-serif; color: #5d6570; }
  @bottom-right { content: counter(page) " / " counter(pages); font: 7.5pt Helvetica, Arial, sans-serif; } }
@media print { html { background: none; } body { margin: 0; padding: 0; max-width: none; box-shadow: none; }
  .banner, .strong td, pre { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .page { break-before: page; } .page h2 { margin-top: 0; } footer { display: none; } .table { overflow: visible; } }
@media screen and (max-width: 60rem) { body { padding: 1.2rem; margin: 0; } dl { grid-template-columns: 1fr 1fr; }
  .across { grid-template-columns: 1fr; } }
"""
