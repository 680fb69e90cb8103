#include "render/fields.hpp"

#include "render/file.hpp"

namespace medulla::render {
namespace {

using nlohmann::json;
constexpr int deepest_json = 8;
constexpr double degree = 3.14159265358979323846 / 180;
const json empty_list = json::array();

std::string range_text(Range r) {
    if (r.high >= 1e9 && r.low <= -1e9) return "a number";
    if (r.high >= 1e9) return fmt::format("a number {} {:g}", r.open_low ? ">" : ">=", r.low);
    return fmt::format("a number in {}{:g}, {:g}]", r.open_low ? '(' : '[', r.low, r.high);
}

}  // namespace

json parse_json(const std::string& text, const std::string& where) {
    int depth = 0;
    const auto shallow = [&](int, json::parse_event_t event, json&) {
        depth += event == json::parse_event_t::object_start || event == json::parse_event_t::array_start;
        depth -= event == json::parse_event_t::object_end || event == json::parse_event_t::array_end;
        if (depth > deepest_json) throw Error("{}: expected at most {} levels of JSON", where, deepest_json);
        return true;
    };
    try {
        return json::parse(text, shallow);
    } catch (const json::exception& error) {
        throw Error("{}: expected JSON: {}", where, printable(error.what(), std::string::npos));
    }
}

std::string quoted(const json& value) { return printable(value.dump(-1, ' ', true, json::error_handler_t::replace)); }

double checked_number(const json& value, const std::string& place, Range range) {
    if (!value.is_number()) throw Error("{}: expected {}, found {}", place, range_text(range), quoted(value));
    const double x = value.get<double>();
    // What is kept is a float: 1e-99 is not above 0.
    const bool inside = x <= range.high && (range.open_low ? float(x) > float(range.low) : x >= range.low);
    if (!inside) throw Error("{}: expected {}, found {:g}", place, range_text(range), x);
    return x;
}

Vec3 checked_vector(const json& value, const std::string& place, Range range) {
    if (!value.is_array() || value.size() != 3)
        throw Error("{}: expected three numbers, found {}", place, quoted(value));
    float v[3];
    for (std::size_t i = 0; i < 3; ++i) v[i] = float(checked_number(value[i], fmt::format("{}/{}", place, i), range));
    return {v[0], v[1], v[2]};
}

Fields::Fields(const json& object, const std::string& where, const std::string& pointer)
    : object_(object), where_(where), pointer_(pointer) {
    if (!object.is_object())
        throw Error("{}: {}: expected an object, found {}", where, pointer.empty() ? "/" : pointer, quoted(object));
}

std::string Fields::place(const std::string& name) const { return where_ + ": " + pointer(name); }

const json* Fields::find(const char* name) {
    known_.insert(name);
    const auto at = object_.find(name);
    return at == object_.end() ? nullptr : &*at;
}

bool Fields::has(const char* name) { return find(name) != nullptr; }

float Fields::number(const char* name, float otherwise, Range range) {
    const json* value = find(name);
    return value == nullptr ? otherwise : float(checked_number(*value, place(name), range));
}

int Fields::whole(const char* name, int otherwise, int low, int high) {
    const json* value = find(name);
    if (value == nullptr) return otherwise;
    if (!value->is_number_integer())
        throw Error("{}: expected a whole number in [{}, {}], found {}", place(name), low, high, quoted(*value));
    const double x = value->get<double>();
    if (x < low || x > high)
        throw Error("{}: expected a whole number in [{}, {}], found {:.0f}", place(name), low, high, x);
    return int(x);
}

float Fields::degrees(const char* name, float otherwise, double low, double high) {
    const json* value = find(name);
    return value == nullptr ? otherwise : float(checked_number(*value, place(name), {low, high}) * degree);
}

Vec3 Fields::vector(const char* name, Vec3 otherwise, Range range) {
    const json* value = find(name);
    return value == nullptr ? otherwise : checked_vector(*value, place(name), range);
}

Rgb Fields::colour(const char* name, Rgb otherwise, Range range) {
    const json* value = find(name);
    if (value == nullptr) return otherwise;
    if (value->is_array()) return checked_vector(*value, place(name), range);
    const float x = float(checked_number(*value, place(name), range));
    return {x, x, x};
}

std::string Fields::text(const char* name, const std::string& otherwise) {
    const json* value = find(name);
    if (value == nullptr) return otherwise;
    if (!value->is_string()) throw Error("{}: expected a text, found {}", place(name), quoted(*value));
    return value->get<std::string>();
}

int Fields::choice(const char* name, const std::vector<std::string>& names, int otherwise) {
    const json* value = find(name);
    if (value == nullptr) return otherwise;
    std::string list;
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (*value == names[i]) return int(i);
        list += (i == 0 ? "" : ", ") + names[i];
    }
    throw Error("{}: expected one of {}; found {}", place(name), list, quoted(*value));
}

const json& Fields::list(const char* name) {
    const json* value = find(name);
    if (value == nullptr) return empty_list;
    if (!value->is_array()) throw Error("{}: expected a list, found {}", place(name), quoted(*value));
    return *value;
}

const json& Fields::value(const char* name) {
    const json* value = find(name);
    if (value == nullptr) throw Error("{}: expected a value, found none", place(name));
    return *value;
}

void Fields::done() const {
    for (const auto& [name, value] : object_.items()) {
        if (known_.count(name) != 0) continue;
        std::string list;
        for (const std::string& known : known_) list += (list.empty() ? "" : ", ") + known;
        throw Error("{}: no such field; expected {}", place(printable(name)), list);
    }
}

}  // namespace medulla::render
