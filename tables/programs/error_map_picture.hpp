// Pictures of the error map's page: colours, cells of a map, lobes and curves as SVG.
#pragma once

#include <string>
#include <vector>

#include "sim3d/model/error_map.hpp"

namespace medulla::tables {

/// Colours of a scale from 0 to 1 (`signed_scale`: from -1, too little, to 1, too much), the same on light and dark
/// pages.
struct Colour {
    int red, green, blue;
    std::string hex() const;
    const char* ink() const;  ///< black or white, whichever reads better on it
};
Colour plain_scale(double share);
Colour signed_scale(double share);

/// Truth, model, difference and difference with the cosine of one lobe over (phi, theta_r), side by side.
std::string lobe_pictures(const sim3d::LobePicture& picture);

/// A curve over theta_i [degrees]; `style` is a class of the page's style sheet.
struct PageCurve {
    std::string label, style;
    std::vector<double> x = {}, y = {};
};
/// One panel of curves from 0 to above all values.
std::string page_chart(const std::string& title, const std::vector<PageCurve>& curves);

}  // namespace medulla::tables
