#pragma once

namespace vibrig::tool {

constexpr int kNo = 1;        ///< exit status: the result says no
constexpr int kBadInput = 2;  ///< exit status: bad usage or input, or no daemon

}  // namespace vibrig::tool
