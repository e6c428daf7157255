// Who watches from outside, carried into the messages of proto/vibrig.proto.
#include "daemon/serve/status_message.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {

void fill_outside(v1::Status& out, const StatusData& status) {
    if (!status.guard.socket.empty()) fill_values(*out.mutable_guard(), "guard.", status);
    if (!status.archive.folder.empty()) fill_values(*out.mutable_archive(), "archive.", status);
    if (status.annunciator.horn || status.annunciator.command)
        fill_values(*out.mutable_annunciator(), "annunciator.", status);
}

}  // namespace vibrig::serve
