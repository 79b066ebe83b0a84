"""How the page of `dsfab reproduce` looks: white paper, four pictures in a row, the structure as large as four."""

STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 3.5rem 2.5rem 5rem; max-width: 96rem; background: PAPER; color: TEXT;
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
h1 { margin: 0 0 .6rem; font-size: 2.1rem; font-weight: 600; letter-spacing: -0.02em; }
h2 { margin: 0; font-size: 1.45rem; font-weight: 600; letter-spacing: -0.01em; }
h2 span, nav span { font-weight: 400; opacity: .6; } h2 span { margin-left: .5rem; font-size: 1rem; }
header p, section > p { max-width: 54rem; margin: .35rem 0 1rem; }
.quiet, small { opacity: .72; } .quiet { font-size: .9rem; }
nav { display: grid; grid-template-columns: repeat(auto-fill, minmax(12.5rem, 1fr)); gap: 1.2rem; margin: 2rem 0; }
nav a { color: inherit; text-decoration: none; font-size: .9rem; } nav a:hover { text-decoration: underline; }
img { display: block; width: 100%; height: auto; } a { border-radius: 4px; }
a:focus-visible { outline: 3px solid rgb(32, 84, 168); outline-offset: 3px; }
section { border-top: 1px solid rgba(86, 80, 76, .25); padding-top: 1.6rem; margin-top: 3rem; }
.steps, .compared { display: grid; gap: 1.4rem 1.2rem; grid-template-columns: repeat(4, minmax(0, 1fr)); }
.compared { grid-template-columns: repeat(var(--across), minmax(0, 24rem)); margin-top: 1rem; }
.large { grid-column: span 2; grid-row: span 2; }
@media (max-width: 60rem) { body { padding: 1.5rem 1rem; }
  .steps { grid-template-columns: repeat(2, minmax(0, 1fr)); } }
figure { margin: 0; } figcaption { font-size: .86rem; line-height: 1.4; padding-top: .35rem; }
figcaption b { display: block; font-weight: 600; } small { display: block; }
.bar { display: flex; gap: .5rem; align-items: center; margin: .15rem 0; font-variant-numeric: tabular-nums; }
.bar i { flex: 0 1 7rem; height: .5rem; }
.why { margin: 0; aspect-ratio: 4 / 3; display: grid; place-content: center; text-align: center; padding: 0 10%;
  border: 1px solid rgba(86, 80, 76, .25); border-radius: 4px; opacity: .75; font-size: .9rem; }
section > .why { aspect-ratio: auto; padding: 2rem; }
.facts { font-size: .92rem; padding-top: .4rem; } .facts p { margin: 0 0 .55rem; }
code { font: 13px/1.5 ui-monospace, SFMono-Regular, Menlo, Consolas, monospace; background: rgba(120, 100, 80, .08);
  padding: .15rem .45rem; border-radius: 4px; }
.tables { margin-top: 1.6rem; display: flex; flex-wrap: wrap; gap: 1rem 3rem; overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .2rem 0; }
th, td { text-align: right; padding: .15rem .6rem; border-bottom: 1px solid rgba(86, 80, 76, .2); white-space: nowrap; }
th { font-weight: 600; } th:first-child, td:first-child { padding-left: 0; } td + td { padding-left: .6rem; }
@media print { body { max-width: none; padding: 0; font-size: 10pt; } section, figure { break-inside: avoid; } }
"""
