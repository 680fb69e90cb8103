#include "render/scene.hpp"

#include "render/creature.hpp"
#include "render/error.hpp"
#include "render/fields.hpp"
#include "render/strand_file.hpp"

namespace medulla::render {
namespace {

using nlohmann::json;

constexpr std::uint64_t greatest_scene = 1 << 24, greatest_baked = 1 << 26;

Camera read_camera(Fields f) {
    Camera c;
    c.from = f.vector("from", c.from), c.to = f.vector("to", c.to), c.up = f.vector("up", c.up);
    c.fov = f.degrees("fov", c.fov, 0.01, 170);
    c.lens_radius = f.number("lens_radius", 0, at_least_0);
    c.focus = f.number("focus", 0, at_least_0);
    f.done();
    if (!(length(c.to - c.from) > 0)) throw Error("{}: expected a point other than from", f.place("to"));
    if (!(length(cross(c.to - c.from, c.up)) > 1e-6f * length(c.to - c.from)))
        throw Error("{}: expected a direction across the view", f.place("up"));
    if (c.focus == 0) c.focus = length(c.to - c.from);
    return c;
}

Picture read_picture(Fields f) {
    Picture p;
    p.width = f.whole("width", p.width, 1, 16384), p.height = f.whole("height", p.height, 1, 16384);
    p.exposure = f.number("exposure", 0, {-30, 30});
    p.filmic = f.choice("tone", {"filmic", "srgb"}, 0) == 0;
    f.done();
    return p;
}

FurParameters<3> preset(const std::string& name, bool printed, const std::string& place) {
    if (const FurPreset* row = find_preset(name.c_str()))
        return printed ? parameters_of<3>(*row) : coloured_parameters_of(*row);
    std::string names;
    for (const FurPreset& row : fur_presets) names += std::string(names.empty() ? "" : ", ") + row.name;
    throw Error("{}: expected one of {}, each also with _corrected; found '{}'", place, names, name);
}

/// The bytes of the file that a field names, beside the scene; its fingerprint goes into scene.text.
std::string named_file(Fields& f, const char* name, std::uint64_t most, Scene& scene, std::string& path) {
    const std::string named = f.text(name, "");
    if (named.empty()) throw Error("{}: expected the name of a file, found none", f.place(name));
    path = path_beside(f.file(), named);
    std::string bytes;
    try {
        bytes = read_file(path, most);
    } catch (const Error& error) {
        throw Error("{}: {}", f.place(name), error.what());
    }
    scene.text += fmt::format("\n{:016x}", fingerprint(bytes.data(), bytes.size()));
    return bytes;
}

std::shared_ptr<const Baked> read_baked(Fields& f, Scene& scene) {
    auto baked = std::make_shared<Baked>();
    std::string path;
    baked->bytes = named_file(f, "baked", greatest_baked, scene, path);
    const BakedResult opened = open_baked(baked->bytes.data(), baked->bytes.size());
    if (opened.status != BakedStatus::ok) throw Error("{}: {}: {}", f.place("baked"), path, describe(opened.status));
    baked->material = opened.material;
    return baked;
}

/// Fields and ranges are those of a material of medulla-precompute's scenes (docs/formats.md).
Material read_material(Fields f, Scene& scene) {
    Material m;
    m.name = f.text("name", "");
    if (m.name.empty()) throw Error("{}: expected a name, found none", f.place("name"));
    const auto read_sigma_ca = [&] {
        FurParameters<3>& p = m.fur;
        const Rgb c = f.colour("sigma_ca", {p.sigma_ca[0], p.sigma_ca[1], p.sigma_ca[2]});
        p.sigma_ca[0] = c.x, p.sigma_ca[1] = c.y, p.sigma_ca[2] = c.z;
    };
    if (f.has("baked")) {  // everything but the colour is fixed
        m.baked = read_baked(f, scene);
        m.fur = m.baked->material.parameters();
        read_sigma_ca();
        f.done();
        return m;
    }
    if (f.has("preset")) {
        const bool printed = f.choice("colour", {"coat", "printed"}, 0) == 1;
        m.fur = preset(f.text("preset", ""), printed, f.place("preset"));
    }
    FurParameters<3>& p = m.fur;
    p.eta = f.number("eta", p.eta, {1, 10, true}), p.kappa = f.number("kappa", p.kappa, share);
    p.alpha = f.degrees("alpha", p.alpha, -90, 90);
    p.beta_m = f.degrees("beta_m", p.beta_m, 0.00573, 229.18),
    p.beta_n = f.degrees("beta_n", p.beta_n, 0.00573, 229.18);
    p.layers = f.number("layers", p.layers, {0, 1000});
    p.sigma_ms = f.number("sigma_ms", p.sigma_ms, at_least_0),
    p.sigma_ma = f.number("sigma_ma", p.sigma_ma, at_least_0);
    read_sigma_ca();
    p.g = f.number("g", p.g, {-0.999, 0.999});
    p.fresnel = static_cast<Fresnel>(f.choice("fresnel", {"bravais", "exact"}, int(p.fresnel)));
    p.scattering = static_cast<Scattering>(f.choice("scattering", {"published", "corrected"}, int(p.scattering)));
    f.done();
    return m;
}

int material_named(const std::vector<Material>& materials, const json& name, const std::string& place) {
    std::string names;
    for (std::size_t i = 0; i < materials.size(); ++i) {
        if (name == materials[i].name) return int(i);
        names += (i == 0 ? "" : ", ") + materials[i].name;
    }
    throw Error("{}: expected one of {}; found {}", place, names.empty() ? "no materials" : names, quoted(name));
}

/// "material": "name", or "along": [[0, "dark"], [1, "white"]]; `otherwise` where there is neither.
std::vector<Stop> read_along(Fields& f, const std::vector<Material>& materials, int otherwise = -1) {
    const bool material = f.has("material"), along = f.has("along");
    if (!material && !along && otherwise >= 0) return {{0, otherwise}};
    if (material == along) throw Error("{}: expected this or along", f.place("material"));
    if (material) return {{0, material_named(materials, f.value("material"), f.place("material"))}};
    std::vector<Stop> stops;
    const json& list = f.list("along");
    for (std::size_t i = 0; i < list.size(); ++i) {
        const std::string place = fmt::format("{}/{}", f.place("along"), i);
        if (!list[i].is_array() || list[i].size() != 2)
            throw Error("{}: expected [place along the strand, material], found {}", place, quoted(list[i]));
        const float at = float(checked_number(list[i][0], place + "/0", share));
        if (!stops.empty() && !(at > stops.back().at))
            throw Error("{}/0: expected a number > {:g}, found {:g}", place, stops.back().at, at);
        stops.push_back({at, material_named(materials, list[i][1], place + "/1")});
        const FurParameters<3>&p = materials[std::size_t(stops.back().material)].fur,
              &first = materials[std::size_t(stops[0].material)].fur;
        if (p.scattering != first.scattering || p.fresnel != first.fresnel)
            throw Error("{}/1: expected a material of the first one's scattering and fresnel, found {}", place,
                        quoted(list[i][1]));
    }
    if (stops.empty()) throw Error("{}: expected at least one entry", f.place("along"));
    return stops;
}

std::shared_ptr<const Texture> read_texture(Fields f, Scene& scene) {
    Texture t;
    t.sets =
        static_cast<Sets>(f.choice("sets", {"sigma_ca", "colour", "kappa", "sigma_ms_factor", "sigma_ca_factor"}, 0));
    t.mapping = static_cast<Mapping>(f.choice("map", {"planar", "around", "strand"}, 0));
    t.scale = f.number("scale", 1, at_least_0);
    if (t.mapping != Mapping::strand) t.origin = f.vector("origin", t.origin);
    if (t.mapping == Mapping::planar) {
        t.u = f.vector("u", t.u), t.v = f.vector("v", t.v);
        if (!(dot(t.u, t.u) > 0)) throw Error("{}: expected an edge, found a vector of length 0", f.place("u"));
        if (!(dot(t.v, t.v) > 0)) throw Error("{}: expected an edge, found a vector of length 0", f.place("v"));
    }
    f.has("file");
    f.done();
    std::string path;
    const std::string bytes = named_file(f, "file", greatest_image_file, scene, path);
    t.image = read_image(path, bytes, t.sets == Sets::colour);
    return std::make_shared<const Texture>(std::move(t));
}

std::vector<std::shared_ptr<const Texture>> read_textures(Fields& f, Scene& scene) {
    std::vector<std::shared_ptr<const Texture>> textures;
    const json& list = f.list("textures");
    for (std::size_t i = 0; i < list.size(); ++i)
        textures.push_back(read_texture({list[i], f.file(), fmt::format("{}/{}", f.pointer("textures"), i)}, scene));
    return textures;
}

Layer read_layer(Fields f, Scene& scene, int material) {
    Layer l;
    l.along = read_along(f, scene.materials, material);
    l.textures = read_textures(f, scene);
    l.colour_noise = f.number("colour_noise", 0, {0, 10});
    l.density = f.number("density", l.density, positive);
    l.length = f.number("length", l.length, positive),
    l.length_noise = f.number("length_noise", l.length_noise, {0, 0.99});
    l.radius = f.number("radius", l.radius, positive);
    l.tip = f.number("tip", l.tip, {0.01, 1}), l.taper = f.number("taper", l.taper, {0, 0.99});
    l.lean = f.degrees("lean", l.lean, 0, 89), l.bend = f.degrees("bend", l.bend, -180, 180);
    l.comb = f.vector("comb", l.comb);
    l.noise = f.degrees("noise", l.noise, 0, 90);
    l.swirl = f.degrees("swirl", 0, 0, 360), l.swirl_size = f.number("swirl_size", l.swirl_size, positive);
    l.curl_radius = f.number("curl_radius", 0, at_least_0),
    l.curl_turns = f.number("curl_turns", l.curl_turns, {0, 1000});
    l.clump_size = f.number("clump_size", 0, at_least_0), l.clump_strength = f.number("clump_strength", 0.7f, share);
    l.segments = f.whole("segments", l.segments, 1, 256);
    l.seed = std::uint32_t(f.whole("seed", 1, 0, 2000000000));
    f.done();
    return l;
}

Placement read_placement(Fields& f) {
    Placement p;
    p.scale = f.number("scale", p.scale, positive);
    p.up = f.choice("up", {"x", "y", "z"}, p.up);
    p.turn = f.degrees("turn", 0, -360, 360);
    p.translate = f.vector("translate", p.translate);
    return p;
}

std::shared_ptr<const Mesh> read_mesh_object(Fields& f, Scene& scene) {
    MeshFile how;
    how.placement = read_placement(f);
    how.clockwise = f.choice("faces", {"counter-clockwise", "clockwise"}, 0) == 1;
    std::string path;
    const std::string bytes = named_file(f, "file", greatest_mesh_file, scene, path);
    return std::make_shared<const Mesh>(read_mesh(path, bytes, how));
}

std::shared_ptr<const Mesh> read_creature(Fields& f) {
    const Placement placement = read_placement(f);
    const float blend = f.number("blend", 0.015f, {0.001, 1e9});
    std::vector<Ball> balls;
    const json& list = f.list("balls");
    if (list.size() > 1000) throw Error("{}: expected at most 1000 balls, found {}", f.place("balls"), list.size());
    for (std::size_t i = 0; i < list.size(); ++i) {
        const std::string place = fmt::format("{}/{}", f.place("balls"), i);
        if (!list[i].is_array() || list[i].size() < 4 || list[i].size() > 5)
            throw Error("{}: expected x, y, z, radius and at will the hairs' length, found {}", place, quoted(list[i]));
        const auto number = [&](std::size_t k, Range range) {
            return float(checked_number(list[i][k], fmt::format("{}/{}", place, k), range));
        };
        const Vec3 centre{number(0, any_number), number(1, any_number), number(2, any_number)};
        balls.push_back({centre, number(3, positive), list[i].size() == 5 ? number(4, at_least_0) : 1});
    }
    if (f.has("balls") && balls.empty()) throw Error("{}: expected at least one ball", f.place("balls"));
    auto mesh = std::make_shared<const Mesh>(creature(balls.empty() ? fox() : balls, blend, placement));
    if (mesh->indices.empty()) throw Error("{}: expected balls that the grid about them can resolve", f.place("balls"));
    return mesh;
}

/// @param coats named lists of layers, which an object may share with others
Object read_object(Fields f, Scene& scene, const json& coats) {
    const std::vector<Material>& materials = scene.materials;
    Object o;
    Shape& s = o.shape;
    s.form = static_cast<Form>(f.choice("shape", {"patch", "sphere", "torus", "mesh", "creature"}, 1));
    if (s.form == Form::mesh) {
        s.mesh = read_mesh_object(f, scene);
    } else if (s.form == Form::creature) {
        s.mesh = read_creature(f);
    } else if (s.form == Form::patch) {
        s.width = f.number("width", 1, positive), s.depth = f.number("depth", 1, positive);
    } else {
        s.radius = f.number("radius", 1, positive);
        if (s.form == Form::torus) s.tube = f.number("tube", 0.4f * s.radius, {0, s.radius, true});
    }
    if (s.mesh == nullptr) s.centre = f.vector("centre", s.centre);
    if (f.has("skin") && f.value("skin").is_null())
        o.has_skin = false;
    else
        o.skin = f.colour("skin", o.skin, share);
    const int material = f.has("material") ? material_named(materials, f.value("material"), f.place("material")) : -1;
    const bool named = f.has("coat") && f.value("coat").is_string();
    if (named && !coats.contains(f.text("coat", "")))
        throw Error("{}: expected layers or one of /coats, found {}", f.place("coat"), quoted(f.value("coat")));
    const json& coat = named ? coats[f.text("coat", "")] : f.list("coat");
    const std::string pointer = named ? "/coats/" + f.text("coat", "") : f.pointer("coat");
    if (!coat.is_array()) throw Error("{}: {}: expected a list, found {}", f.file(), pointer, quoted(coat));
    for (std::size_t i = 0; i < coat.size(); ++i)
        o.coat.push_back(read_layer({coat[i], f.file(), fmt::format("{}/{}", pointer, i)}, scene, material));
    f.done();
    return o;
}

Strands read_strand_object(Fields f, Scene& scene) {
    StrandFile how;
    how.placement = read_placement(f);
    if (f.has("radius")) how.radius = f.number("radius", 0, positive);
    how.radius_scale = f.number("radius_scale", 1, positive);
    const std::vector<Stop> along = read_along(f, scene.materials);
    const auto textures = read_textures(f, scene);
    const float colour_noise = f.number("colour_noise", 0, {0, 10});
    const auto seed = std::uint32_t(f.whole("seed", 1, 0, 2000000000));
    f.has("strands");
    f.done();
    std::string path;
    const std::string bytes = named_file(f, "strands", greatest_strand_file, scene, path);
    Strands strands = read_strands(path, bytes, how);
    strands.along = along, strands.textures = textures;
    strands.colour_noise = colour_noise, strands.seed = seed;
    return strands;
}

SingleFibre read_fibre(Fields f, const std::vector<Material>& materials) {
    SingleFibre s;
    s.along = read_along(f, materials);
    s.radius = f.number("radius", s.radius, positive), s.tip = f.number("tip", s.tip, {0.01, 1});
    const json& points = f.list("points");
    if (points.size() < 2) throw Error("{}: expected at least two points, found {}", f.place("points"), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::string place = fmt::format("{}/{}", f.place("points"), i);
        s.points.push_back(checked_vector(points[i], place, any_number));
        if (i > 0 && !(length(s.points[i] - s.points[i - 1]) > 0))
            throw Error("{}: expected a point other than the one before", place);
    }
    f.done();
    return s;
}

Ground read_ground(Fields f) {
    Ground g;
    g.present = true;
    g.height = f.number("height", g.height), g.size = f.number("size", g.size, positive);
    g.wall = f.number("wall", 0, at_least_0);
    g.colour = f.colour("colour", g.colour, share);
    f.done();
    return g;
}

Vec3 direction(Fields& f, const char* name, Vec3 otherwise) {
    const Vec3 v = f.vector(name, otherwise);
    if (!(length(v) > 0)) throw Error("{}: expected a direction, found a vector of length 0", f.place(name));
    return normalise(v);
}

std::shared_ptr<const Environment> read_environment(Fields& f, Scene& scene) {
    const float turn = f.degrees("turn", 0, -360, 360);
    const Rgb scale = f.colour("scale", {1, 1, 1});
    std::string path;
    const std::string bytes = named_file(f, "file", greatest_image_file, scene, path);
    return std::make_shared<const Environment>(read_image(path, bytes), turn, scale, path);
}

Light read_light(Fields f, Scene& scene) {
    Light l;
    l.form = static_cast<LightForm>(f.choice("light", {"sky", "sun", "rectangle", "environment"}, 0));
    if (l.form == LightForm::environment) {
        l.environment = read_environment(f, scene);
        f.done();
        return l;
    }
    l.radiance = f.colour(l.form == LightForm::sun ? "irradiance" : "radiance", l.radiance);
    if (l.form == LightForm::sun) {
        l.direction = direction(f, "direction", l.direction);
        l.angle = 0.5f * f.degrees("diameter", 2 * l.angle, 0.01, 90);
    } else if (l.form == LightForm::rectangle) {
        const Vec3 centre = f.vector("centre", {0, 3, 0}), to = f.vector("to", {0, 0, 0});
        if (!(length(to - centre) > 0)) throw Error("{}: expected a point other than centre", f.place("to"));
        const float width = f.number("width", 1, positive), height = f.number("height", 1, positive);
        const Vec3 facing = normalise(to - centre);
        const Vec3 side = std::abs(facing.y) < 0.999f ? normalise(cross({0, 1, 0}, facing)) : Vec3{1, 0, 0};
        const Vec3 rise = cross(facing, side);  // side x rise = facing
        l.edge_a = width * side, l.edge_b = height * rise;
        l.corner = centre - 0.5f * l.edge_a - 0.5f * l.edge_b;
    }
    f.done();
    return l;
}

}  // namespace

Scene parse_scene(const std::string& text, const std::string& where) {
    const json file = parse_json(text, where);
    Scene scene;
    scene.text = text;
    Fields f(file, where, "");
    const json nothing = json::object();
    const auto part = [&](const char* name) {
        return Fields(f.has(name) ? f.value(name) : nothing, where, f.pointer(name));
    };
    const auto each = [&](const char* name, auto&& read) {
        const json& list = f.list(name);
        for (std::size_t i = 0; i < list.size(); ++i) read(Fields(list[i], where, fmt::format("/{}/{}", name, i)));
    };
    scene.camera = read_camera(part("camera"));
    scene.picture = read_picture(part("picture"));
    each("materials", [&](Fields m) { scene.materials.push_back(read_material(std::move(m), scene)); });
    const json& coats = f.has("coats") ? f.value("coats") : nothing;
    if (!coats.is_object()) throw Error("{}: expected an object, found {}", f.place("coats"), quoted(coats));
    each("objects", [&](Fields o) {
        if (o.has("strands"))
            scene.strands.push_back(read_strand_object(std::move(o), scene));
        else
            scene.objects.push_back(read_object(std::move(o), scene, coats));
    });
    each("fibres", [&](Fields s) { scene.fibres.push_back(read_fibre(std::move(s), scene.materials)); });
    each("lights", [&](Fields l) { scene.lights.push_back(read_light(std::move(l), scene)); });
    if (f.has("ground")) scene.ground = read_ground(part("ground"));
    f.done();
    if (scene.lights.empty()) throw Error("{}: expected at least one light, found none", f.place("lights"));
    if (scene.objects.empty() && scene.strands.empty() && scene.fibres.empty())
        throw Error("{}: expected at least one object or one of fibres, found none", f.place("objects"));
    return scene;
}

Scene read_scene(const std::string& path) { return parse_scene(read_file(path, greatest_scene), path); }

}  // namespace medulla::render
