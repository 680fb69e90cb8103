// libFuzzer: the command lines of both programs, one word per line. The first byte says which program. Words are parsed
// and checked as the program does it; nothing is run.
#define main medulla_precompute_main
#include "tables/programs/medulla_precompute.cpp"
#undef main

#include "tables/programs/commands.hpp"

namespace {

std::vector<std::string> words_of(const unsigned char* data, std::size_t size) {
    std::vector<std::string> words(1);
    for (std::size_t i = 0; i < size; ++i)
        if (data[i] == '\n')
            words.emplace_back();
        else if (data[i] != 0)  // no word of a command line holds a zero byte
            words.back() += static_cast<char>(data[i]);
    return words;
}

// Declared once, since that takes longer than to parse; CLI11 forgets what it parsed before.
struct Precompute {
    CLI::App app{"fuzz"};
    Words words;
    Precompute() { declare(app, words); }
};
struct Furtable {
    CLI::App app{"fuzz"};
    Action action;
    Furtable() { add_commands(app, action); }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    if (size == 0 || size > 4096) return 0;
    std::vector<std::string> words = words_of(data + 1, size - 1);
    for (const std::string& word : words)
        if (word.empty()) return 0;            // refused before they are parsed (tables/programs/program.cpp)
    std::reverse(words.begin(), words.end());  // CLI11 takes a vector from its end
    try {
        if (data[0] % 2 == 0) {
            static Precompute program;
            program.words = Words();
            program.app.parse(words);
            const Job job = job_of(program.words);
            if (job.shard && (job.shard->index < 1 || job.shard->index > job.shard->count)) std::abort();
            check_request(job.request);
        } else {
            static Furtable program;
            program.app.parse(words);
        }
    } catch (const CLI::Error&) {
    } catch (const Error&) {
    }
    return 0;
}
