// External JSON and text. JSON is parsed to a limited depth, since nlohmann::json recurses in dump and copies. File
// names are bytes, but JSON is UTF-8.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tables/error.hpp"

namespace medulla::tables {

inline constexpr int deepest_json = 8;

/// Bytes as UTF-8, reversibly: a byte that is not part of a UTF-8 character becomes \xHH, a backslash two.
std::string json_name(const std::string& bytes);

/// JSON on one line; bytes of strings that are not UTF-8 become U+FFFD.
template <class Json>
std::string json_line(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Throws Error that begins with `where` for text that is not JSON or is nested deeper than deepest_json.
template <class Json = nlohmann::json>
Json parse_json(const char* first, const char* last, const std::string& where) {
    int depth = 0;
    const auto shallow = [&](int, typename Json::parse_event_t event, Json&) {
        depth += event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start;
        depth -= event == Json::parse_event_t::object_end || event == Json::parse_event_t::array_end;
        if (depth > deepest_json) throw Error("{}: expected at most {} levels of JSON", where, deepest_json);
        return true;
    };
    try {
        return Json::parse(first, last, shallow);
    } catch (const typename Json::exception& error) {
        // The message quotes the input, which may be any bytes.
        std::string text = error.what();
        for (char& c : text)
            if (c < ' ' || c > '~') c = '?';
        throw Error("{}: expected JSON: {}", where, text);
    }
}

}  // namespace medulla::tables
