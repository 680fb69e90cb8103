// libFuzzer: command lines of both programs, one argument per line; the first byte selects the program. Arguments are
// parsed and checked as by the program; nothing is executed.
#define main medulla_precompute_main
#include "tables/programs/medulla_precompute.cpp"
#undef main

#include "tables/programs/commands.hpp"

namespace {

std::vector<std::string> arguments_of(const unsigned char* data, std::size_t size) {
    std::vector<std::string> arguments(1);
    for (std::size_t i = 0; i < size; ++i)
        if (data[i] == '\n')
            arguments.emplace_back();
        else if (data[i] != 0)  // no argument contains a zero byte
            arguments.back() += static_cast<char>(data[i]);
    return arguments;
}

// Declared once, since that takes longer than parsing; CLI11 resets its state at each parse.
struct Precompute {
    CLI::App app{"fuzz"};
    Arguments args;
    Precompute() { declare(app, args); }
};
struct Furtable {
    CLI::App app{"fuzz"};
    Action action;
    Furtable() { add_commands(app, action); }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    if (size == 0 || size > 4096) return 0;
    std::vector<std::string> arguments = arguments_of(data + 1, size - 1);
    for (const std::string& argument : arguments)
        if (argument.empty()) return 0;                // refused before parsing (tables/programs/program.cpp)
    std::reverse(arguments.begin(), arguments.end());  // CLI11 expects the vector in reverse order
    try {
        if (data[0] % 2 == 0) {
            static Precompute program;
            program.args = Arguments();
            program.app.parse(arguments);
            if (program.app.count("--error-map") > 0) return 0;
            if (program.app.count("--fibre") > 0) {
                fibre_arguments(program.app, program.args);
                return 0;
            }
            const Job job = job_of(program.args);
            if (job.share && (job.share->index < 1 || job.share->index > job.share->count)) std::abort();
            check_request(job.request);
        } else {
            static Furtable program;
            program.app.parse(arguments);
        }
    } catch (const CLI::Error&) {
    } catch (const Error&) {
    }
    return 0;
}
