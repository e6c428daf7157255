#include "daemon/record/hdf5.hpp"

#include <fcntl.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <functional>
#include <iterator>
#include <numeric>
#include <sstream>
#include <utility>

#include "proto/text.hpp"

namespace vibrig::record::hdf5 {

namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

/// The library prints to standard error unless switched off, in each thread.
void quiet() {
    // A file whose closing a sick disk refused is not closed a second time at exit: the library
    // crashes there. Whoever ends has closed the others.
    static const bool first = H5dont_atexit() >= 0;
    static_cast<void>(first);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

std::string what_it_says() {
    std::string text;
    const auto take = [](unsigned, const H5E_error2_t* error, void* to) -> herr_t {
        auto& out = *static_cast<std::string*>(to);
        if (error->desc == nullptr) return 0;
        std::string_view words = error->desc;
        // The system's own words stand behind time, file and numbers.
        constexpr std::string_view kSystem = "error message = '";
        if (const auto at = words.find(kSystem); at != std::string_view::npos) {
            words.remove_prefix(at + kSystem.size());
            out = words.substr(0, words.find('\''));
            return 1;  // who called whom adds nothing
        }
        if (out.empty()) out = words;  // of who called whom the innermost
        return 0;
    };
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take, &text);
    // A close on the way out may have taken its words with it.
    return text.empty() ? std::string("HDF5 gives no reason; ") + std::strerror(errno) : text;
}

std::int64_t native(Type type) {
    const std::array<hid_t, 7> types{H5T_NATIVE_DOUBLE, H5T_NATIVE_INT64,  H5T_NATIVE_UINT64,
                                     H5T_NATIVE_INT32,  H5T_NATIVE_UINT32, H5T_NATIVE_UINT8,
                                     H5T_NATIVE_UINT8};
    return types[static_cast<std::size_t>(type)];
}

/// Ends with a zero only where there is room, as h5py, Octave and MATLAB take it.
Handle text_type(std::size_t size) {
    Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type.get(), std::max<std::size_t>(size, 1));
    H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
    return type;
}

/// Of an attribute. All texts are UTF-8; datasets are declared with the default, ASCII, since
/// Octave refuses a whole file with a dataset that says UTF-8, and other readers hand over the
/// bytes.
Handle attribute_type(std::size_t size) {
    Handle type = text_type(size);
    H5Tset_cset(type.get(), H5T_CSET_UTF8);
    return type;
}

// Of a chunk's place in the file, read again by nobody but who reads the file. Bytes in the file;
// in memory they are thrice as much, and a writer that may keep them does so for hours.
constexpr std::size_t kWritersMetadata = 64 * 1024, kReadersMetadata = 1024 * 1024;

Handle access_list(std::size_t metadata_bytes) {
    Handle list(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_libver_bounds(list.get(), H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
    // Of each column a chunk or two, the full ones given up first. The library's 1 MB would fill
    // with what is written already, for hours, in every one of some forty columns; and where a
    // chunk is four dwells, a column of them would hold a thousand: it has room for a few.
    constexpr std::size_t kSlots = 7, kBytes = 32 * 1024;
    H5Pset_cache(list.get(), 0, kSlots, kBytes, 1.0);
    // It stays as large as it begins.
    H5AC_cache_config_t metadata{};
    metadata.version = H5AC__CURR_CACHE_CONFIG_VERSION;
    if (H5Pget_mdc_config(list.get(), &metadata) >= 0) {
        metadata.set_initial_size = true;
        metadata.initial_size = metadata.min_size = metadata.max_size = metadata_bytes;
        metadata.incr_mode = H5C_incr__off;
        metadata.flash_incr_mode = H5C_flash_incr__off;
        metadata.decr_mode = H5C_decr__off;
        H5Pset_mdc_config(list.get(), &metadata);
    }
    return list;
}

std::vector<std::size_t> dimensions_of(const Handle& set) {
    const Handle space(H5Dget_space(set.get()), H5Sclose);
    const int rank = H5Sget_simple_extent_ndims(space.get());
    std::vector<hsize_t> found(static_cast<std::size_t>(std::max(rank, 0)));
    H5Sget_simple_extent_dims(space.get(), found.data(), nullptr);
    return {found.begin(), found.end()};
}

/// Of an attribute; 0 where it has no values, or more dimensions than a length.
hssize_t count_in(const Handle& attribute) {
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    return space.get() < 0 ? 0 : H5Sget_simple_extent_npoints(space.get());
}

constexpr const char* kNames = "names";

std::string joined(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : " ") + name;
    return all;
}

/// Of values in an array of those dimensions.
std::size_t count_of(const std::vector<std::size_t>& dimensions) {
    return std::accumulate(dimensions.begin(), dimensions.end(), std::size_t{1}, std::multiplies{});
}

/// Likewise, where the dimensions are anybody's: more than any file holds rather than too few.
std::size_t count_said(const std::vector<std::size_t>& dimensions) {
    constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max() / 2;
    std::size_t count = 1;
    for (const std::size_t d : dimensions) count = d > 0 && count > kMost / d ? kMost : count * d;
    return count;
}

}  // namespace

Handle& Handle::operator=(Handle&& other) noexcept {
    if (this != &other) {
        reset();
        id_ = std::exchange(other.id_, -1);
        close_ = other.close_;
    }
    return *this;
}

bool Handle::reset() noexcept {
    if (id_ < 0 || close_ == nullptr) return true;
    return close_(std::exchange(id_, -1)) >= 0;
}

void File::fail(const std::string& object) const {
    throw Error(path_ + ": " + (object.empty() ? "" : object + ": ") + what_it_says());
}

File File::create(const std::string& path) {
    quiet();
    File file;
    file.path_ = path;
    file.file_ = Handle(
        H5Fcreate(path.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, access_list(kWritersMetadata).get()),
        H5Fclose);
    if (file.file_.get() < 0) file.fail("");
    return file;
}

File File::open(const std::string& path, Mode mode) {
    quiet();
    File file;
    file.path_ = path;
    const Handle list = access_list(kReadersMetadata);
    const auto attempt = [&](unsigned flags) {
        file.file_ = Handle(H5Fopen(path.c_str(), flags, list.get()), H5Fclose);
        return file.file_.get() >= 0;
    };
    if (mode == Mode::mend) {
        // What h5clear does: the flags of a writer that is gone are cleared at opening, and where
        // its last allocations end is taken from the file's size. It is written down last, behind
        // what points there.
        const hbool_t yes = 1;
        H5Pset(list.get(), "clear_status_flags", &yes);
        H5Pset(list.get(), "skip_eof_check", &yes);
        if (!attempt(H5F_ACC_RDWR) || H5Fincrement_filesize(file.file_.get(), 0) < 0) file.fail("");
    } else if (mode == Mode::write) {
        if (!attempt(H5F_ACC_RDWR)) file.fail("");
    } else if (!attempt(H5F_ACC_RDONLY) && !attempt(H5F_ACC_RDONLY | H5F_ACC_SWMR_READ)) {
        file.fail("");
    }
    return file;
}

void File::start_swmr(const std::string& path) {
    if (H5Fstart_swmr_write(file_.get()) < 0) fail("SWMR");
    // Never over another file.
    if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE) != 0)
        throw Error(path + ": " + std::strerror(errno));
    path_ = path;
}

void File::flush() {
    if (H5Fflush(file_.get(), H5F_SCOPE_LOCAL) < 0) fail("flush");
}

void File::close() {
    if (!file_.reset()) fail("close");
}

void File::make_group(const std::string& name) {
    const Handle group(H5Gcreate2(file_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                       H5Gclose);
    if (group.get() < 0) fail(name);
}

bool File::has(const std::string& name) const {
    // Every step of the path must be there to be asked for the next.
    for (std::size_t end = 0; end != std::string::npos;) {
        end = name.find('/', end + 1);
        const std::string step = name.substr(0, end);
        const htri_t there = H5Lexists(file_.get(), step.c_str(), H5P_DEFAULT);
        H5L_info_t info{};
        if (there == 0) return false;
        if (there < 0 || H5Lget_info(file_.get(), step.c_str(), &info, H5P_DEFAULT) < 0) fail(step);
        // It may lead to any file of this machine, and a pipe is waited for.
        if (info.type != H5L_TYPE_HARD)
            throw Error(path_ + ": " + step + ": found a link, expected what it leads to");
    }
    return true;
}

void File::attribute(const std::string& object, const char* name, std::int64_t type,
                     const void* value) {
    if (H5Aexists_by_name(file_.get(), object.c_str(), name, H5P_DEFAULT) > 0)
        H5Adelete_by_name(file_.get(), object.c_str(), name, H5P_DEFAULT);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    const Handle made(H5Acreate_by_name(file_.get(), object.c_str(), name, type, space.get(),
                                        H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                      H5Aclose);
    if (made.get() < 0 || H5Awrite(made.get(), type, value) < 0)
        fail(object + ": attribute " + name);
}

void File::set(const std::string& object, const char* name, std::string_view text) {
    std::string padded(text);
    padded.resize(std::max<std::size_t>(text.size(), 1));
    attribute(object, name, attribute_type(padded.size()).get(), padded.data());
}

void File::set(const std::string& object, const char* name, std::int64_t number) {
    attribute(object, name, H5T_NATIVE_INT64, &number);
}

std::string File::text(const std::string& object, const char* name) const {
    const Handle found(H5Aopen_by_name(file_.get(), object.c_str(), name, H5P_DEFAULT, H5P_DEFAULT),
                       H5Aclose);
    if (found.get() < 0) fail(object + ": attribute " + name);
    const Handle type(H5Aget_type(found.get()), H5Tclose);
    if (H5Tget_class(type.get()) != H5T_STRING || count_in(found) != 1)
        throw Error(path_ + ": " + object + ": attribute " + name +
                    ": found no text, expected one");
    if (H5Tis_variable_str(type.get()) > 0) {  // as h5py writes it
        char* read = nullptr;
        if (H5Aread(found.get(), type.get(), static_cast<void*>(&read)) < 0)
            fail(object + ": attribute " + name);
        std::string text = read == nullptr ? "" : read;
        H5free_memory(read);
        return text;
    }
    std::string text(H5Tget_size(type.get()), '\0');
    if (H5Aread(found.get(), type.get(), text.data()) < 0) fail(object + ": attribute " + name);
    return text.c_str();
}

std::int64_t File::number(const std::string& object, const char* name) const {
    const Handle found(H5Aopen_by_name(file_.get(), object.c_str(), name, H5P_DEFAULT, H5P_DEFAULT),
                       H5Aclose);
    std::int64_t number = 0;
    if (found.get() >= 0 && count_in(found) != 1)
        throw Error(path_ + ": " + object + ": attribute " + name +
                    ": found no single number, expected one");
    if (found.get() < 0 || H5Aread(found.get(), H5T_NATIVE_INT64, &number) < 0)
        fail(object + ": attribute " + name);
    return number;
}

void File::write_set(const std::string& name, const Handle& space, std::int64_t type,
                     const void* values) {
    if (has(name)) H5Ldelete(file_.get(), name.c_str(), H5P_DEFAULT);
    const Handle made(H5Dcreate2(file_.get(), name.c_str(), type, space.get(), H5P_DEFAULT,
                                 H5P_DEFAULT, H5P_DEFAULT),
                      H5Dclose);
    if (made.get() < 0 || H5Dwrite(made.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)
        fail(name);
}

void File::write_text(const std::string& name, std::string_view text,
                      std::string_view description) {
    std::string padded(text);
    padded.resize(std::max<std::size_t>(text.size(), 1));
    write_set(name, Handle(H5Screate(H5S_SCALAR), H5Sclose), text_type(padded.size()).get(),
              padded.data());
    set(name, "description", description);
}

std::string File::read_text(const std::string& name) const {
    const auto all = texts(name);
    return all.empty() ? std::string() : all.front();
}

void File::write_numbers(const std::string& name, std::span<const double> values,
                         const std::vector<std::size_t>& dimensions, std::string_view unit,
                         std::string_view description) {
    const std::vector<hsize_t> size(dimensions.begin(), dimensions.end());
    write_set(
        name,
        Handle(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose),
        H5T_NATIVE_DOUBLE, values.data());
    set(name, "unit", unit);
    set(name, "description", description);
}

Handle File::open_set(const std::string& name) const {
    if (!has(name)) throw Error(path_ + ": " + name + ": found nothing, expected a dataset");
    Handle set(H5Dopen2(file_.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
    if (set.get() < 0) fail(name);
    const Handle list(H5Dget_create_plist(set.get()), H5Pclose);
    if (H5Pget_external_count(list.get()) > 0 || H5Pget_layout(list.get()) == H5D_VIRTUAL)
        throw Error(path_ + ": " + name + ": found values of another file, expected them in this");
    return set;
}

std::size_t File::values_in(const Handle& set, const std::string& name) const {
    // A few bytes may say that they are any number of values. What is compressed is so by a
    // thousand at most, and what a writer that died has not placed in the file is a second or two.
    constexpr std::size_t kCompressed = 1100, kUnplaced = 1 << 20;
    const std::size_t count = count_said(dimensions_of(set));
    const std::size_t bytes = H5Dget_storage_size(set.get());
    if (count > kUnplaced && count / kCompressed > bytes)
        throw Error(path_ + ": " + name + ": found " + std::to_string(count) + " values in " +
                    std::to_string(bytes) + " bytes, expected as many as they hold");
    return count;
}

template <typename T>
Array<T> File::read(const std::string& name, std::int64_t type) const {
    const Handle set = open_set(name);
    const Handle held(H5Dget_type(set.get()), H5Tclose);
    if (const auto kind = H5Tget_class(held.get()); kind != H5T_INTEGER && kind != H5T_FLOAT)
        throw Error(path_ + ": " + name + ": found no numbers, expected them");
    Array<T> array{dimensions_of(set), {}};
    array.values.resize(values_in(set, name));
    if (!array.values.empty() &&
        H5Dread(set.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, array.values.data()) < 0)
        fail(name);
    return array;
}

Array<double> File::doubles(const std::string& name) const {
    return read<double>(name, H5T_NATIVE_DOUBLE);
}
Array<std::int64_t> File::integers(const std::string& name) const {
    return read<std::int64_t>(name, H5T_NATIVE_INT64);
}

std::vector<std::string> File::texts(const std::string& name) const {
    const Handle set = open_set(name);
    const Handle type(H5Dget_type(set.get()), H5Tclose);
    if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) > 0)
        throw Error(path_ + ": " + name + ": found no texts of fixed size, expected them");
    const std::size_t size = H5Tget_size(type.get());
    const std::size_t count = values_in(set, name);
    std::string all(size * count, '\0');
    if (count > 0 && H5Dread(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()) < 0)
        fail(name);
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < count; ++i) {
        std::string text = all.substr(i * size, size);
        text.resize(std::min(text.find('\0'), text.size()));
        texts.push_back(std::move(text));
    }
    return texts;
}

std::vector<std::size_t> File::dimensions(const std::string& name) const {
    return dimensions_of(open_set(name));
}

std::vector<std::size_t> File::places(const std::string& name, const Names& names) const {
    const Handle set = open_set(name);
    const auto refuse = [&](const std::string& found, const std::string& expected) {
        throw Error(path_ + ": " + name + ": found " + found + ", expected " + expected);
    };
    const auto dimensions = dimensions_of(set);
    if (dimensions.size() != 2)
        refuse(std::to_string(dimensions.size()) + " dimensions", "2: rows and numbers in a row");
    const std::size_t width = dimensions[1];
    const std::string numbers = std::to_string(width) + " numbers in a row";
    const std::string most = std::to_string(names.now.size()) + " (" + joined(names.now) + ")";
    std::vector<std::string> found = names.unnamed;
    if (H5Aexists(set.get(), kNames) > 0) {
        std::istringstream words(text(name, kNames));
        found.assign(std::istream_iterator<std::string>(words), {});
        if (found.size() != width)
            refuse(numbers, std::to_string(found.size()) + " by its names " +
                                proto::printable(joined(found)));
    }
    if (width == 0) refuse(numbers, "1 to " + most);
    if (width > found.size())
        refuse(numbers + " without names", std::to_string(found.size()) + " at most");
    found.resize(width);
    std::vector<std::size_t> places;
    for (const std::string& one : found) {
        const auto at = std::ranges::find(names.now, one) - names.now.begin();
        const auto place = static_cast<std::size_t>(at);
        if (place == names.now.size())
            refuse(numbers + ", one of them " + proto::printable(one),
                   "at most " + most + "; a newer vibrigd wrote it");
        if (std::ranges::find(places, place) != places.end())
            refuse(proto::printable(one) + " twice among its names", "it once");
        places.push_back(place);
    }
    return places;
}

namespace {

/// What a dying disk did not take must not look like a measurement: no number, no time, and a
/// quality that is not good.
void set_fill(std::int64_t list, Type type) {
    constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
    constexpr std::uint8_t kNotGood = 1;
    if (type == Type::f64) H5Pset_fill_value(list, H5T_NATIVE_DOUBLE, &kNoNumber);
    if (type == Type::i64) H5Pset_fill_value(list, H5T_NATIVE_INT64, &kUnwritten);
    if (type == Type::u8) H5Pset_fill_value(list, H5T_NATIVE_UINT8, &kNotGood);
}

}  // namespace

Table::Table(File& file, std::string group, std::vector<ColumnSpec> columns, std::size_t chunk_rows,
             const char* description)
    : file_(&file), group_(std::move(group)) {
    file.make_group(group_);
    file.set(group_, "description", description);
    for (auto& spec : columns) {
        Column& column = add(std::move(spec));
        std::vector<hsize_t> size{0}, most{H5S_UNLIMITED}, chunk{chunk_rows};
        for (const std::size_t d : column.spec.shape) {
            size.push_back(d);
            most.push_back(d);
            chunk.push_back(d);
        }
        const Handle space(
            H5Screate_simple(static_cast<int>(size.size()), size.data(), most.data()), H5Sclose);
        const Handle list(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
        H5Pset_chunk(list.get(), static_cast<int>(chunk.size()), chunk.data());
        set_fill(list.get(), column.spec.type);
        column.dataset = Handle(H5Dcreate2(file.id(), column.name.c_str(), column.type.get(),
                                           space.get(), H5P_DEFAULT, list.get(), H5P_DEFAULT),
                                H5Dclose);
        if (column.dataset.get() < 0) file.fail(column.name);
        if (*column.spec.unit != '\0') file.set(column.name, "unit", column.spec.unit);
        file.set(column.name, "description", column.spec.description);
        if (column.spec.names != nullptr)
            file.set(column.name, kNames, joined(column.spec.names->now));
    }
}

Table::Table(File& file, std::string group, std::vector<ColumnSpec> columns)
    : file_(&file), group_(std::move(group)) {
    for (auto& spec : columns) {
        Column& column = add(std::move(spec));
        if (column.spec.newer && !file.has(column.name)) continue;
        column.dataset = file.open_set(column.name);
        rows_ = dimensions_of(column.dataset).at(0);
        if (column.spec.names == nullptr) continue;
        column.places = file.places(column.name, *column.spec.names);
        column.spec.shape = {column.places.size()};
    }
}

Table::Column& Table::add(ColumnSpec spec) {
    Column& column = columns_.emplace_back();
    column.name = group_ + "/" + spec.name;
    column.type = spec.type == Type::text ? text_type(spec.text_bytes)
                                          : Handle(H5Tcopy(native(spec.type)), H5Tclose);
    column.bytes = count_of(spec.shape) * H5Tget_size(column.type.get());
    column.spec = std::move(spec);
    return column;
}

void Table::keep(std::size_t rows) {
    for (Column& column : columns_) {
        if (column.dataset.get() < 0) continue;
        const auto found = dimensions_of(column.dataset);
        std::vector<hsize_t> size(found.begin(), found.end());
        size.at(0) = std::min<hsize_t>(size.at(0), rows);
        if (H5Dset_extent(column.dataset.get(), size.data()) < 0) file_->fail(column.name);
    }
    rows_ = rows;
}

void Table::put(const void* cell, std::size_t size) {
    Column& column = columns_[next_];
    if (size != column.bytes) throw std::logic_error(column.name + ": a cell of another size");
    const auto* bytes = static_cast<const unsigned char*>(cell);
    const auto keep = [&](std::size_t from, std::size_t count) {
        column.buffer.insert(column.buffer.end(), bytes + from, bytes + from + count);
    };
    const std::size_t number = H5Tget_size(column.type.get());
    for (const std::size_t place : column.places) keep(place * number, number);
    if (column.places.empty() && column.dataset.get() >= 0) keep(0, size);
    next_ = (next_ + 1) % columns_.size();
    if (next_ == 0) ++waiting_;
}

void Table::put(std::string_view text) {
    std::string padded(text.substr(0, columns_[next_].bytes));
    padded.resize(columns_[next_].bytes);
    put(padded.data(), padded.size());
}

void Table::commit() {
    if (waiting_ == 0) return;
    for (Column& column : columns_) {
        if (column.dataset.get() < 0) continue;
        std::vector<hsize_t> start{rows_}, count{waiting_}, size{rows_ + waiting_};
        for (const std::size_t d : column.spec.shape) {
            start.push_back(0);
            count.push_back(d);
            size.push_back(d);
        }
        if (H5Dset_extent(column.dataset.get(), size.data()) < 0) file_->fail(column.name);
        const Handle in_file(H5Dget_space(column.dataset.get()), H5Sclose);
        H5Sselect_hyperslab(in_file.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(),
                            nullptr);
        const Handle in_memory(
            H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
        if (H5Dwrite(column.dataset.get(), column.type.get(), in_memory.get(), in_file.get(),
                     H5P_DEFAULT, column.buffer.data()) < 0)
            file_->fail(column.name);
        column.buffer.clear();
    }
    rows_ += waiting_;
    waiting_ = 0;
}

}  // namespace vibrig::record::hdf5
