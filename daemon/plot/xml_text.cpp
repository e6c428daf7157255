#include "daemon/plot/xml_text.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "proto/text.hpp"

namespace vibrig::tool::plot {

std::string xml_text(const std::string& text) {
    using Entity = std::pair<char, const char*>;
    constexpr std::array<Entity, 4> kEntities{
        {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}}};
    std::string out;
    for (const char c : proto::mend_utf8(text)) {
        const auto entity = std::ranges::find(kEntities, c, &Entity::first);
        if (entity != kEntities.end())
            out += entity->second;
        else
            out += static_cast<unsigned char>(c) < 0x20 && c != '\n' ? ' ' : c;
    }
    return out;
}

}  // namespace vibrig::tool::plot
