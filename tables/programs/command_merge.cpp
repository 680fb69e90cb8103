// furtable merge: the parts of many workers -> one tables file.
#include <fmt/core.h>

#include "tables/programs/commands.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/merge.hpp"
#include "tables/store/slices.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

struct MergeWords {
    std::vector<std::string> parts;
    std::string output;
    bool json = false;
};

void run_merge(const MergeWords& words) {
    const Output output(words.output, words.parts);
    if (!words.json) print_messages();
    const Tables tables = merge(words.parts);
    write_tables(output, tables, Compression::zstd);
    const std::string hash = hex(contents_hash(tables));
    const std::size_t slices = slices_of(tables).size();
    if (words.json)
        print("{}\n", json_line(nlohmann::ordered_json{
                          {"output", json_name(words.output)}, {"slices", slices}, {"sha256", hash}}));
    else
        print("{}: {}, SHA-256 of the contents {}\n", words.output, counted(slices, "slice"), hash);
}

}  // namespace

void add_merge(CLI::App& app, Action& action) {
    add_command<MergeWords>(
        app, action, "merge", "parts of a job -> one tables file",
        [](CLI::App& command, MergeWords& words) {
            command
                .add_option("SHARD", words.parts,
                            "folders OUTPUT.shards (or the OUTPUT they belong to) and tables files that hold parts")
                ->required();
            command.add_option("-o,--output", words.output, "tables file to write")->required();
            command.add_flag("--json", words.json, "print one JSON object");
        },
        run_merge);
}

}  // namespace medulla::tables
