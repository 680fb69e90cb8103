#include "tables/program.hpp"

#include <cstdio>
#include <new>

namespace medulla::tables {

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
    const auto complain = [&](std::string text) {
        // One line, whatever stood in a file or a word that it quotes.
        for (char& c : text)
            if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
        fmt::print(stderr, "{}: {}\n", app.get_name(), text);
        std::fflush(stderr);
    };
    try {
        // CLI11 2.1 never ends on some short options after an empty word, which none of ours can be.
        for (int i = 1; i < argc; ++i)
            if (argv[i][0] == '\0') throw UsageError("expected no empty word, found one as number {}", i);
        app.parse(argc, argv);
        action();
        if (std::fflush(stdout) != 0) throw Error("standard output: cannot be written");
        return 0;
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& error) {
        complain(error.what());
        return 2;
    } catch (const UsageError& error) {
        complain(error.what());
        return 2;
    } catch (const Interrupted& interrupted) {
        complain(interrupted.what());
        return 128 + interrupted.signal;
    } catch (const std::bad_alloc&) {
        complain("not enough memory");
    } catch (const std::exception& error) {
        complain(error.what());
    }
    return 1;
}

}  // namespace medulla::tables
