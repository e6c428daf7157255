// Verdict, loop check and safe-state proof, carried into the messages of proto/vibrig.proto.
#include <cmath>

#include "daemon/serve/status_message.hpp"
#include "proto/text.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {

namespace {

void fill_row(v1::LoopCheck::Row& to, const CheckRow& row) {
    to.set_name(proto::mend_utf8(row.name));
    to.set_unit(proto::mend_utf8(row.unit));
    if (std::isfinite(row.value)) to.set_value(row.value);
    if (std::isfinite(row.low)) to.set_low(row.low);
    if (std::isfinite(row.high)) to.set_high(row.high);
    to.set_passed(row.passed());
}

void fill_loop_check(v1::LoopCheck& out, const LoopCheckStatus& check) {
    out.set_verdict(*check.verdict == '\0' ? "none" : check.verdict);
    out.set_by(proto::mend_utf8(check.by));
    out.set_message(proto::mend_utf8(check.message));
    for (const CheckRow& row : check.rows) fill_row(*out.add_rows(), row);
}

void fill_rest_check(v1::RestCheck& out, const RestCheckStatus& check) {
    out.set_verdict(*check.verdict == '\0' ? "none" : check.verdict);
    out.set_by(proto::mend_utf8(check.by));
    out.set_utc_ns(check.utc_ns);
    out.set_message(proto::mend_utf8(check.message));
    for (const auto& suspect : check.suspects) out.add_suspects(proto::mend_utf8(suspect));
}

void fill_proof(v1::Proof& out, const ProofStatus& proof) {
    out.set_demanded(proof.demanded);
    out.set_refusal(proto::mend_utf8(proof.refusal));
    out.set_advice(proof.advice);
    out.set_by(proto::mend_utf8(proof.by));
    out.set_utc_ns(proof.utc_ns);
    out.set_passed(proof.passed);
    out.set_message(proto::mend_utf8(proof.message));
    out.set_asks(proof.asks);
    for (const CheckRow& row : proof.rows) fill_row(*out.add_rows(), row);
    for (const auto& past : proof.history) {
        v1::Proof::Past& to = *out.add_history();
        to.set_utc_ns(past.utc_ns);
        to.set_passed(past.passed);
        to.set_stop_s(past.stop_s);
        to.set_watchdog_s(past.watchdog_s);
        to.set_table_s(past.table_s);
    }
    out.set_keys_sha256(proof.keys_sha256);
    out.set_table_g(proof.table_g);
    out.set_trend(proto::mend_utf8(proof.trend));
}

}  // namespace

void fill(v1::Verdict& out, const StatusData& status) {
    fill_values(out, "verdict.", status);
    if (!status.verdict.residuals) return;
    for (const auto& r : *status.verdict.residuals) {
        v1::Verdict::Residual& to = *out.add_residuals();
        to.set_run(r.run);
        to.set_position(r.position);
        to.set_time_h(r.time_h);
        to.set_x_deg_h(r.value[0]);
        to.set_y_deg_h(r.value[1]);
        to.set_z_deg_h(r.value[2]);
        to.set_x_sigma_deg_h(r.sigma[0]);
        to.set_y_sigma_deg_h(r.sigma[1]);
        to.set_z_sigma_deg_h(r.sigma[2]);
    }
}

void fill_checks(v1::Status& out, const StatusData& status) {
    fill_loop_check(*out.mutable_loop_check(), status.loop_check);
    fill_rest_check(*out.mutable_rest_check(), status.rest_check);
    fill_proof(*out.mutable_proof(), status.proof);
}

}  // namespace vibrig::serve
