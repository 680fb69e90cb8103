// Draws a figure with gnuplot: we write the script, gnuplot draws, we read the picture back. The same figure and the
// same gnuplot give the same bytes.
#pragma once

#include <optional>
#include <string>

#include "plot/figure.hpp"

namespace medulla::plot {

enum class Format { svg, png, html };  ///< html: the SVG in a page

/// The format that a file's name ends in: .svg, .png or .html.
std::optional<Format> format_of(const std::string& path);

/// The whole input of gnuplot: terminal, layout, data, curves.
std::string gnuplot_script(const Figure& figure, Format format);

/// The picture's bytes. Throws std::runtime_error with one line if gnuplot is missing or refuses.
std::string draw(const Figure& figure, Format format);

}  // namespace medulla::plot
