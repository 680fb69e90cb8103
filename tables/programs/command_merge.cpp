// furtable merge: parts of a job -> one tables file.
#include <fmt/core.h>

#include "tables/programs/commands.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/merge.hpp"
#include "tables/store/slices.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

struct MergeArguments {
    std::vector<std::string> parts;
    std::string output;
    bool json = false;
};

void run_merge(const MergeArguments& args) {
    const Output output(args.output, args.parts);
    if (!args.json) print_messages();
    const Tables tables = merge(args.parts);
    write_tables(output, tables, Compression::zstd);
    const std::string hash = hex(contents_hash(tables));
    const std::size_t slices = slices_of(tables).size();
    if (args.json)
        print("{}\n", json_line(nlohmann::ordered_json{
                          {"output", json_name(args.output)}, {"slices", slices}, {"sha256", hash}}));
    else
        print("{}: {}, SHA-256 of the contents {}\n", args.output, counted(slices, "slice"), hash);
}

}  // namespace

void add_merge(CLI::App& app, Action& action) {
    add_command<MergeArguments>(
        app, action, "merge", "parts of a job -> one tables file",
        [](CLI::App& command, MergeArguments& args) {
            command
                .add_option("SHARD", args.parts,
                            "folders OUTPUT.shards (or their OUTPUT) with the slice files of workers, and tables files "
                            "of parts")
                ->required();
            command.add_option("-o,--output", args.output, "tables file to write")->required();
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_merge);
}

}  // namespace medulla::tables
