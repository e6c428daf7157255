#include "daemon/tool/recordings/mat_file.hpp"

#include <matio.h>

#include <array>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace vibrig::tool {
namespace {

struct Free {
    void operator()(matvar_t* variable) const noexcept { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, Free>;

std::size_t hash_of(const matvar_t& variable) {
    return std::hash<std::string_view>{}(
        {static_cast<const char*>(variable.data), variable.nbytes});
}

}  // namespace

void MatFile::Close::operator()(_mat_t* file) const noexcept { Mat_Close(file); }

MatFile::MatFile(std::string path) : path_(std::move(path)), out_(path_) {
    if (std::filesystem::exists(path_) && !std::filesystem::is_regular_file(path_))
        throw std::runtime_error(path_ + ": found no regular file, expected one or a new name");
    file_.reset(Mat_CreateVer(out_.place().c_str(), nullptr, MAT_FT_MAT5));
    if (file_ == nullptr) throw std::runtime_error(path_ + ": cannot be written");
}

void MatFile::add(const std::string& name, const std::vector<double>& values, std::size_t width) {
    const std::size_t rows = values.size() / width;
    // MATLAB keeps columns together.
    std::vector<double> turned(values.size());
    for (std::size_t r = 0; r < rows; ++r) {
        for (std::size_t c = 0; c < width; ++c) turned[c * rows + r] = values[r * width + c];
    }
    std::array<std::size_t, 2> size{rows, width};
    write(name, Mat_VarCreate(name.c_str(), MAT_C_DOUBLE, MAT_T_DOUBLE, 2, size.data(),
                              turned.data(), 0));
}

void MatFile::add(const std::string& name, std::string text) {
    std::array<std::size_t, 2> size{1, text.size()};
    write(name,
          Mat_VarCreate(name.c_str(), MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0));
}

void MatFile::write(const std::string& name, matvar_t* variable) {
    const Variable owned(variable);
    if (!owned || Mat_VarWrite(file_.get(), variable, MAT_COMPRESSION_ZLIB) != 0)
        throw std::runtime_error(path_ + ": " + name + ": cannot be written");
    added_.push_back({name, hash_of(*variable)});
}

void MatFile::finish() {
    file_.reset();
    std::unique_ptr<_mat_t, Close> file(Mat_Open(out_.place().c_str(), MAT_ACC_RDONLY));
    for (const Added& added : added_) {
        const Variable found(file ? Mat_VarRead(file.get(), added.name.c_str()) : nullptr);
        if (!found || hash_of(*found) != added.hash)
            throw std::runtime_error(path_ + ": " + added.name +
                                     ": cannot be written whole; is the disk full?");
    }
    file.reset();
    out_.finish();
}

}  // namespace vibrig::tool
