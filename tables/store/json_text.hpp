// JSON from outside: parsed only as deep as ours ever is, since walking over it (dump, copies) recurses.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tables/error.hpp"

namespace medulla::tables {

inline constexpr int deepest_json = 8;

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
