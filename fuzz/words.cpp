// libFuzzer: the command lines of both programs, one word per line. The first byte says which program. Words are parsed
// and checked as the program does it; nothing is run.
#define main medulla_precompute_main
#include "tables/medulla_precompute.cpp"
#undef main

#include "tables/commands.hpp"

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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    if (size == 0 || size > 4096) return 0;
    std::vector<std::string> words = words_of(data + 1, size - 1);
    for (const std::string& word : words)
        if (word.empty()) return 0;            // refused before they are parsed (tables/program.cpp)
    std::reverse(words.begin(), words.end());  // CLI11 takes a vector from its end
    try {
        CLI::App app("fuzz");
        if (data[0] % 2 == 0) {
            Words declared;
            declare(app, declared);
            app.parse(words);
            const Job job = job_of(declared);
            if (job.shard && (job.shard->index < 1 || job.shard->index > job.shard->count)) std::abort();
            check_request(job.request);
        } else {
            Action action;
            add_commands(app, action);
            app.parse(words);
        }
    } catch (const CLI::Error&) {
    } catch (const Error&) {
    }
    return 0;
}
