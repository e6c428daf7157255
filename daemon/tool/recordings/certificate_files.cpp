#include "daemon/tool/recordings/certificate_files.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "proto/durable_file.hpp"

namespace vibrig::tool {

namespace {

constexpr std::array kKinds{".html", ".json", ".pdf"};

[[noreturn]] void there_already(const std::string& path) {
    throw std::runtime_error(path +
                             ": found it there already, expected a new name: a certificate that "
                             "was issued is not written over");
}

}  // namespace

CertificateFiles::CertificateFiles(std::string output)
    : output_(std::move(output)), own_(output_ + ".unfinished-" + std::to_string(::getpid())) {
    for (const char* kind : kKinds) {
        proto::check_output(output_ + kind);
        std::error_code none;
        const auto what = std::filesystem::symlink_status(output_ + kind, none).type();
        if (what != std::filesystem::file_type::not_found) there_already(output_ + kind);
    }
}

CertificateFiles::~CertificateFiles() {
    std::error_code none;
    for (const std::string& path : taken_) std::filesystem::remove(path, none);
    if (kept_) return;
    for (const char* kind : kKinds) std::filesystem::remove(own_ + kind, none);
}

std::string CertificateFiles::path(const char* kind) const { return own_ + kind; }

void CertificateFiles::take_names() {
    for (const char* kind : kKinds) {
        const std::string path = output_ + kind;
        const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file < 0 && errno == EEXIST) there_already(path);
        if (file < 0)
            throw std::runtime_error(path + ": cannot be written: " + std::strerror(errno));
        ::close(file);
        taken_.push_back(path);
    }
}

void CertificateFiles::issue() {
    for (const char* kind : kKinds) {
        std::error_code error;
        std::filesystem::rename(own_ + kind, output_ + kind, error);
        if (error) {
            kept_ = true;
            throw std::runtime_error(output_ + kind + ": cannot get its name: " + error.message() +
                                     "; " + whereabouts());
        }
        taken_.erase(taken_.begin());
    }
}

std::string CertificateFiles::whereabouts() const {
    return "the certificate's files are " + own_ + ".html, .json and .pdf";
}

}  // namespace vibrig::tool
