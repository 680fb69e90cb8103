// The style sheet of the error map's page: light and dark, down to a phone's width.
#pragma once

namespace medulla::tables {

inline constexpr const char* error_map_style = R"(
:root{color-scheme:light dark;--ink:#1b1b1b;--soft:#5c5c5c;--line:#c9c9c9;--paper:#fff;--model:#c24e00;--cosine:#0072b2}
@media(prefers-color-scheme:dark){:root{--ink:#e6e6e6;--soft:#a3a3a3;--line:#474747;--paper:#161616;--model:#ff8a3d;--cosine:#6cc3f0}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:68rem;padding:1rem;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.5rem;line-height:1.25;margin:.3em 0}h2{font-size:1.2rem;margin:2em 0 .4em}h3{font-size:1rem;margin:1.4em 0 .3em}
p{max-width:46rem;margin:.5em 0}.note{color:var(--soft);font-size:.875rem}
sub,sup{line-height:0}.wrap{overflow-x:auto;margin:.6em 0}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9375rem}
th,td{padding:.2em .6em;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th{font-weight:600}thead th{vertical-align:bottom}
th:first-child,td:first-child{text-align:left;white-space:normal}
.why{display:block;color:var(--soft);font-size:.8125rem;line-height:1.3;padding-bottom:.15em}
tr.part td:first-child{padding-left:1.4em;color:var(--soft)}tr.sum>*{border-top:2px solid var(--line);font-weight:600}
small{color:var(--soft);font-size:.8em}
.quiet{color:var(--soft)}
.map{font-size:.8125rem;line-height:1.2}
.map td{padding:.2em .1em;text-align:center;border:1px solid var(--paper);width:3.9em}
.map td small{display:block;color:inherit;opacity:.8;font-size:.78em}
.map th{padding:.1em .3em;border:0;font-weight:400;color:var(--soft);text-align:center;white-space:nowrap}
.map td.blank{background:repeating-linear-gradient(45deg,transparent 0 4px,var(--line) 4px 5px);color:var(--ink)}
.lobes,.charts{display:grid;gap:1rem;grid-template-columns:repeat(auto-fit,minmax(15rem,1fr))}
figure{margin:0}figcaption{font-size:.875rem}
svg{width:100%;height:auto;display:block;font:11px system-ui,sans-serif;fill:var(--ink);background:var(--paper)}
.blank{fill:var(--line)}.frame,.grid{fill:none;stroke:var(--soft)}.grid{stroke:var(--line);stroke-width:.5}
.bar{display:flex;gap:.5em;align-items:center;font-size:.8125rem}.bar i{flex:1;height:.6em}
polyline{fill:none;stroke-width:1.6}
.truth,.truth polyline{stroke:var(--ink);color:var(--ink);fill:var(--ink)}
.model,.model polyline{stroke:var(--model);color:var(--model);fill:var(--model)}
.cosine,.cosine polyline{stroke:var(--cosine);color:var(--cosine);fill:var(--cosine)}
svg polyline{fill:none!important}
.key{display:flex;flex-wrap:wrap;gap:0 1em;font-size:.875rem}.key span:before{content:"● "}
@media(max-width:480px){body{padding:.75rem}table{font-size:.8125rem}th,td{padding:.2em .3em}
.map{font-size:.625rem}th{white-space:normal!important}.map td{width:auto;padding:.2em 0}.map th{padding:.1em .15em}table:not(.map) small{display:block;line-height:1.1}table:not(.map) td:first-child{min-width:3rem}}
)";

}  // namespace medulla::tables
