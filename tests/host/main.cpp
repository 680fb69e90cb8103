#include <cstdio>

#include "medulla/medulla.hpp"

int main() {
    const medulla::OpenResult opened = medulla::open_pack(medulla::default_pack_words, medulla::default_pack_size);
    int shortened = 1.5;  // warns under flags of medulla's own, if they leaked into this target
    std::printf("%d\n", shortened);
    return opened.status == medulla::PackStatus::ok ? 0 : 1;
}
