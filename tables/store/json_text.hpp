// JSON and text from outside: parsed only as deep as ours ever is, since walking over it (dump, copies) recurses; names
// of files are bytes, of which JSON holds only UTF-8.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tables/error.hpp"

namespace medulla::tables {

inline constexpr int deepest_json = 8;

/// Bytes as text that JSON holds and from which they can be told again: a byte that is no part of a UTF-8 character is
/// written \xHH, a backslash as two.
std::string json_name(const std::string& bytes);

/// JSON on one line, whatever bytes its strings hold: what is no UTF-8 there becomes U+FFFD.
template <class Json>
std::string json_line(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Throws Error that begins with `where` for text that is no JSON or nests deeper than deepest_json.
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
        // Its message repeats what it read, whatever bytes these are.
        std::string text = error.what();
        for (char& c : text)
            if (c < ' ' || c > '~') c = '?';
        throw Error("{}: expected JSON: {}", where, text);
    }
}

}  // namespace medulla::tables
