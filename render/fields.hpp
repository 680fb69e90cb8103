// Typed, checked access to the fields of a JSON object. Every failure is one line: file, field, expected, found.
#pragma once

#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "render/error.hpp"
#include "render/vector.hpp"

namespace medulla::render {

/// Throws Error that begins with `where` for text that is not JSON or nests deeper than any scene.
nlohmann::json parse_json(const std::string& text, const std::string& where);

struct Range {
    double low, high;
    bool open_low = false;  ///< the range excludes low
};
inline constexpr Range any_number{-1e9, 1e9}, positive{0, 1e9, true}, at_least_0{0, 1e9}, share{0, 1};

/// One object of the file. `done` refuses all fields that have not been read.
class Fields {
  public:
    /// @param pointer JSON pointer of the object in the file `where`
    Fields(const nlohmann::json& object, const std::string& where, const std::string& pointer);

    bool has(const char* name);
    float number(const char* name, float otherwise, Range range = any_number);
    int whole(const char* name, int otherwise, int low, int high);
    float degrees(const char* name, float otherwise, double low, double high);  ///< radians in and out
    Vec3 vector(const char* name, Vec3 otherwise, Range range = any_number);
    Rgb colour(const char* name, Rgb otherwise, Range range = at_least_0);  ///< one number or three
    std::string text(const char* name, const std::string& otherwise);
    /// The index of a text among `names`.
    int choice(const char* name, const std::vector<std::string>& names, int otherwise);
    const nlohmann::json& list(const char* name);  ///< an empty list where it is absent
    const nlohmann::json& value(const char* name);
    std::string place(const std::string& name) const;  ///< "file: /objects/0/name"
    std::string pointer(const std::string& name) const { return pointer_ + "/" + name; }
    const std::string& file() const { return where_; }
    void done() const;

  private:
    const nlohmann::json* find(const char* name);
    const nlohmann::json& object_;
    std::string where_, pointer_;
    std::set<std::string> known_;
};

double checked_number(const nlohmann::json& value, const std::string& place, Range range);
Vec3 checked_vector(const nlohmann::json& value, const std::string& place, Range range);
/// A value as quoted in a message.
std::string quoted(const nlohmann::json& value);

}  // namespace medulla::render
