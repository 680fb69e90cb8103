// A scene as read from its file (docs/render.md). Lengths in world units, angles in radians (degrees in the file).
// Rests on the runtime's FurParameters.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "medulla/baked.hpp"
#include "medulla/fur_parameters.hpp"
#include "render/environment.hpp"
#include "render/mesh.hpp"
#include "render/strands.hpp"
#include "render/texture.hpp"

namespace medulla::render {

struct Camera {
    Vec3 from{0, 0, 4}, to{0, 0, 0}, up{0, 1, 0};
    float fov = 0.6f;       ///< full vertical angle [radians]
    float lens_radius = 0;  ///< 0: a pinhole
    float focus = 0;        ///< distance of the plane in focus; 0: that of `to`
};

struct Picture {
    int width = 512, height = 512;
    float exposure = 0;  ///< stops
    bool filmic = true;  ///< the PNG's tone curve; otherwise plain sRGB
};

/// A baked pack with the bytes that its material reads. docs/truth.md, 'Bake'.
struct Baked {
    std::string bytes;
    BakedMaterial material;
};

struct Material {
    std::string name;
    FurParameters<3> fur;                ///< of a baked one those of its bake, but for sigma_ca
    std::shared_ptr<const Baked> baked;  ///< null: the five-lobe model
};

struct Layer {
    std::vector<Stop> along;
    std::vector<std::shared_ptr<const Texture>> textures;
    float colour_noise = 0;  ///< variation of sigma_ca from strand to strand: factors exp(+-colour_noise)
    float density = 1000;    ///< strands per unit of area
    float length = 0.2f, length_noise = 0.2f;  ///< noise: share of the length, uniform in +-
    float radius = 0.002f;                     ///< at the root
    float tip = 0.2f;                          ///< radius at the tip over that at the root
    float taper = 0.5f;                        ///< position along the strand from which it narrows
    float lean = 0.5f, bend = 0.5f;            ///< angle from the normal at the root; further angle up to the tip
    Vec3 comb{0, -1, 0};                       ///< direction of the lean, projected onto the skin
    float noise = 0.1f;                        ///< random angle from strand to strand
    float swirl = 0, swirl_size = 0.5f;        ///< largest smooth turn of the comb across the coat; its length scale
    float curl_radius = 0, curl_turns = 2;
    float clump_size = 0, clump_strength = 0;  ///< distance between clumps; how far tips join them, [0, 1]
    int segments = 6;
    std::uint32_t seed = 1;
};

enum class Form { patch, sphere, torus, mesh, creature };

struct Shape {
    Form form = Form::sphere;
    Vec3 centre;
    float radius = 1, tube = 0.4f;     ///< sphere and torus (about y); the torus' tube
    float width = 1, depth = 1;        ///< patch, in the plane y = 0, seen from above
    std::shared_ptr<const Mesh> mesh;  ///< of mesh and creature, in world space
};

struct Object {
    Shape shape;
    bool has_skin = true;
    Rgb skin{0.3f, 0.2f, 0.15f};  ///< diffuse albedo
    std::vector<Layer> coat;
};

/// One fibre by the points it passes through.
struct SingleFibre {
    std::vector<Stop> along;
    std::vector<Vec3> points;  ///< at least two
    float radius = 0.01f, tip = 1;
};

/// A floor, and a wall behind it, rounded where they meet.
struct Ground {
    bool present = false;
    float height = -1;  ///< y
    float size = 20;    ///< half its width
    float wall = 0;     ///< distance behind the origin (-z) at which the floor curves up; 0: no wall
    Rgb colour{0.4f, 0.4f, 0.4f};
};

enum class LightForm { sky, sun, rectangle, environment };

struct Light {
    LightForm form = LightForm::sky;
    Rgb radiance{1, 1, 1};        ///< sun: irradiance across its direction
    Vec3 direction{0, 1, 0};      ///< sun: towards it
    float angle = 0.0046f;        ///< sun: half its angular diameter [radians]
    Vec3 corner, edge_a, edge_b;  ///< rectangle: lit on the side of cross(edge_a, edge_b)
    std::shared_ptr<const Environment> environment;
};

struct Scene {
    Camera camera;
    Picture picture;
    std::vector<Material> materials;
    std::vector<Object> objects;
    std::vector<Strands> strands;  ///< from files
    std::vector<SingleFibre> fibres;
    Ground ground;
    std::vector<Light> lights;
    std::string text;  ///< the file, and fingerprints of those that it names: identifies the scene for --resume
};

/// Throws Error: one line with file, field, expected and found.
Scene read_scene(const std::string& path);
Scene parse_scene(const std::string& text, const std::string& where);

}  // namespace medulla::render
