// Who watches from outside, carried into the messages of proto/vibrig.proto.
#include "daemon/serve/status_message.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {

namespace {

void fill_guard(v1::Guard& out, const GuardStatus& guard) {
    out.set_socket(mend_utf8(guard.socket));
    out.set_heard(guard.heard);
    out.set_note(mend_utf8(guard.note));
    out.set_cause(guard.cause);
    out.set_text(guard.text);
    out.set_disobeyed(guard.disobeyed);
    out.set_sees(guard.sees);
    out.set_rest(guard.rest);
    out.set_reaches_shaker(guard.reaches_shaker);
    out.set_horn_confirms(guard.horn_confirms);
    out.set_table_g(guard.table_g);
}

void fill_annunciator(v1::Annunciator& out, const drivers::AnnunciatorStatus& annunciator) {
    out.set_horn(annunciator.horn);
    out.set_confirms(annunciator.confirms);
    out.set_horn_note(mend_utf8(annunciator.horn_note));
    out.set_pattern(drivers::name_of(annunciator.pattern));
    out.set_command(annunciator.command);
    out.set_started(annunciator.started);
    out.set_failed(annunciator.failed);
    out.set_timed_out(annunciator.timed_out);
    out.set_left_out(annunciator.left_out);
    out.set_command_note(mend_utf8(annunciator.command_note));
}

void fill_archive(v1::Archive& out, const ArchiveStatus& archive) {
    out.set_folder(mend_utf8(archive.folder));
    out.set_good(archive.good);
    out.set_note(mend_utf8(archive.note));
    out.set_delivering(mend_utf8(archive.delivering));
    out.set_waiting(archive.waiting);
    out.set_waiting_bytes(archive.waiting_bytes);
    out.set_delivered(archive.delivered);
    out.set_failures(archive.failures);
    out.set_removed(archive.removed);
}

}  // namespace

void fill(v1::Mqtt& out, const MqttStatus& mqtt) {
    out.set_broker(mend_utf8(mqtt.broker));
    out.set_connected(mqtt.connected);
    out.set_note(mend_utf8(mqtt.note));
    out.set_connections(mqtt.connections);
    out.set_births(mqtt.births);
    out.set_messages(mqtt.messages);
    out.set_left_out(mqtt.left_out);
}

void fill(v1::Log& out, const LogStatus& log) {
    out.set_taken(log.taken);
    out.set_written(log.written);
    out.set_dropped(log.dropped);
    out.set_waiting(log.waiting);
    out.set_blocked(log.blocked);
}

void fill_outside(v1::Status& out, const StatusData& status) {
    if (!status.guard.socket.empty()) fill_guard(*out.mutable_guard(), status.guard);
    if (!status.archive.folder.empty()) fill_archive(*out.mutable_archive(), status.archive);
    if (status.annunciator.horn || status.annunciator.command)
        fill_annunciator(*out.mutable_annunciator(), status.annunciator);
}

}  // namespace vibrig::serve
