#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace vibrig::drivers {

/// Starts a program as the leader of a process group of its own, so that all that it starts can be
/// killed with it. It gets the usual signals and these three descriptors, -1: /dev/null, and no
/// other: sockets and journals are not for it, whoever forgot to mark them. Returns an errno, 0 if
/// it runs.
[[nodiscard]] int start_process_group(std::vector<std::string> arguments, int in, int out,
                                      int error, pid_t& leader);

}  // namespace vibrig::drivers
