#include "proto/open_end.hpp"

#include <iostream>
#include <mutex>

#include "proto/text.hpp"

namespace vibrig::proto {

std::string tell_open_end(const std::string& place, std::string_view field) {
    std::string text = place + ": found no end of line behind '" + printable(field) +
                       "', expected one: the file may have been cut, within this field even";
    // Some read a file once for each column.
    static std::mutex one_at_a_time;
    static std::string told;
    const std::lock_guard lock(one_at_a_time);
    if (told != text) std::cerr << "warning: " << text << std::endl;
    told = text;
    return text;
}

std::string cut_fields(std::size_t found, std::size_t expected, std::string_view field, bool read) {
    if (found < expected)
        return "found " + std::to_string(found) + " fields and no end of line, expected " +
               std::to_string(expected) + ": the file was cut";
    if (field.empty() && read)
        return "found nothing in the last field and no end of line, expected both: the file was "
               "cut";
    return "";
}

}  // namespace vibrig::proto
