// Material and scene files (JSON): docs/formats.md. Angles in them are degrees, as in Table 4 of Yan 2017.
#pragma once

#include <string>
#include <vector>

#include "medulla/fur_parameters.hpp"

namespace medulla::tables {

struct Material {
    std::string name;
    FurParameters<3> fur;
    bool grey = true;  ///< sigma_ca is one number, not three
};

/// One material of a file: {"name": .., "preset": .., "eta": .., ..}. The preset is applied first; fields override it.
Material read_material(const std::string& path);
/// The materials of a scene file: {"materials": [..]}.
std::vector<Material> read_scene(const std::string& path);
/// The same from text; messages name `where` as the file.
Material parse_material(const std::string& text, const std::string& where);
std::vector<Material> parse_scene(const std::string& text, const std::string& where);
/// A row of Table 4 by name; throws Error that lists the names there are.
Material preset_material(const std::string& name, const std::string& where);

}  // namespace medulla::tables
