#include "tables/store/sha256.hpp"

#include <openssl/evp.h>

#include "tables/error.hpp"

namespace medulla::tables {

struct Sha256::State {
    EVP_MD_CTX* context = EVP_MD_CTX_new();
    ~State() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
    if (!state_->context || EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) != 1)
        throw Error("libcrypto gives no SHA-256");
}

Sha256::~Sha256() = default;

void Sha256::add(const void* data, std::size_t size) {
    if (EVP_DigestUpdate(state_->context, data, size) != 1) throw Error("libcrypto: SHA-256 failed");
}

Digest Sha256::finish() {
    Digest digest;
    unsigned size = 0;
    if (EVP_DigestFinal_ex(state_->context, digest.data(), &size) != 1 || size != digest.size())
        throw Error("libcrypto: SHA-256 failed");
    return digest;
}

Digest sha256(std::string_view bytes) {
    Sha256 hash;
    hash.add(bytes.data(), bytes.size());
    return hash.finish();
}

std::string hex(const Digest& digest) {
    std::string text;
    for (const unsigned char byte : digest) text += fmt::format("{:02x}", byte);
    return text;
}

}  // namespace medulla::tables
