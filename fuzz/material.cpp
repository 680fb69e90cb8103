// libFuzzer: text -> a material, a scene. Accepted materials must be valid fibres of the model.
#include <cstdlib>

#include "medulla/fur_parameters.hpp"
#include "tables/error.hpp"
#include "tables/job/material.hpp"

using namespace medulla;
using namespace medulla::tables;

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    const std::string text(reinterpret_cast<const char*>(data), size);
    try {
        if (out_of_range(parse_material(text, "fuzz").fur) != 0) std::abort();
    } catch (const Error&) {
    }
    try {
        for (const Material& material : parse_scene(text, "fuzz"))
            if (out_of_range(material.fur) != 0) std::abort();
    } catch (const Error&) {
    }
    return 0;
}
