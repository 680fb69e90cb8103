// What ptxas says of a kernel: registers, local memory, spills. No GPU is needed, only an nvcc.
#pragma once

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

namespace medulla::bench {

struct KernelFigures {
    std::string name, architecture;
    int registers = 0, stack_bytes = 0, spilled_bytes = 0;  ///< a thread's; spills: stores and loads
};

/// The nvcc of CUDA_PATH, CUDA_HOME, the path, or where CUDA's installer puts it; empty: none.
inline std::string find_nvcc() {
    std::vector<std::string> folders;
    for (const char* name : {"CUDA_PATH", "CUDA_HOME"})
        if (const char* value = std::getenv(name)) folders.push_back(std::string(value) + "/bin");
    if (const char* path = std::getenv("PATH")) {
        const std::string all = path;
        for (std::size_t from = 0, to; from <= all.size(); from = to + 1) {
            to = std::min(all.find(':', from), all.size());
            folders.push_back(all.substr(from, to - from));
        }
    }
    folders.push_back("/usr/local/cuda/bin");
    for (const std::string& folder : folders)
        if (!folder.empty() && std::ifstream(folder + "/nvcc").good()) return folder + "/nvcc";
    return {};
}

/// Compiles `source` and reads ptxas' report of every kernel in it. Empty with a message on stderr where that fails.
inline std::vector<KernelFigures> ptxas_figures(const std::string& nvcc, const std::string& source,
                                                const std::string& include) {
    const std::string command =
        "\"" + nvcc + "\" -std=c++17 -O3 -Xptxas -v -cubin -o /dev/null -I\"" + include + "\" \"" + source + "\" 2>&1";
    std::FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return {};
    std::string report;
    std::array<char, 4096> piece;
    while (std::fgets(piece.data(), int(piece.size()), pipe) != nullptr) report += piece.data();
    if (pclose(pipe) != 0) {
        std::fprintf(stderr, "%s: does not compile\n%s", source.c_str(), report.c_str());
        return {};
    }
    std::vector<KernelFigures> kernels;
    std::size_t from = 0;
    while (from < report.size()) {
        const std::size_t to = std::min(report.find('\n', from), report.size());
        const std::string line = report.substr(from, to - from);
        from = to + 1;
        char name[256], architecture[32];
        int stores = 0, loads = 0, registers = 0, stack = 0;
        const std::size_t entry = line.find("Compiling entry function '"), used = line.find("Used "),
                          cumulative = line.find(" bytes cumulative stack");
        if (entry != std::string::npos &&
            std::sscanf(line.c_str() + entry, "Compiling entry function '%255[^']' for '%31[^']'", name,
                        architecture) == 2)
            kernels.push_back({name, architecture, 0, 0, 0});
        if (kernels.empty() || kernels.back().registers != 0) continue;  // functions follow their kernel's own lines
        if (std::sscanf(line.c_str(), " %d bytes stack frame, %d bytes spill stores, %d bytes spill loads", &stack,
                        &stores, &loads) == 3)
            kernels.back().stack_bytes = stack, kernels.back().spilled_bytes = stores + loads;
        if (used == std::string::npos || std::sscanf(line.c_str() + used, "Used %d registers", &registers) != 1)
            continue;
        kernels.back().registers = registers;
        if (cumulative == std::string::npos) continue;  // no calls: the frame is all
        std::size_t digits = cumulative;
        while (digits > 0 && line[digits - 1] >= '0' && line[digits - 1] <= '9') --digits;
        kernels.back().stack_bytes = std::atoi(line.c_str() + digits);
    }
    return kernels;
}

}  // namespace medulla::bench
