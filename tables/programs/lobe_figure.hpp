// The picture of furtable plot: lobes of one file as coloured lines, those of further files dashed over them, and their
// differences below.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plot/figure.hpp"
#include "tables/pack/source.hpp"

namespace medulla::tables {

/// One column of panels: the (sigma, g) to draw; the nearest nodes of the first file are.
struct PlotPoint {
    double sigma, g;
};

/// `names` are the sources' paths. Throws Error where two files share no kind of lobe, or a further file does not reach
/// as far as the first.
plot::Figure lobe_figure(const std::vector<std::unique_ptr<Source>>& sources, const std::vector<std::string>& names,
                         const std::vector<PlotPoint>& points);

}  // namespace medulla::tables
