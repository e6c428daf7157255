#include "daemon/results/spectrum_text.hpp"

#include <array>

#include "daemon/results/text_line.hpp"

namespace vibrig::tool {

namespace {

using namespace estimator::spectrum;

constexpr std::array<const char*, 3> kGyros{"x", "y", "z"};
// Rates that tell nothing weigh about 0; one to seven says no.
constexpr double kExcluded = -2;

}  // namespace

std::span<const char* const> not_shown() {
    static constexpr std::array kStatements{
        "motion of the platform in step with the vibration is drift (coning), and in random "
        "vibration it is not seen by slow samples",
        "elliptic motion, vibration in quadrature between two axes, is not excited by a shaker "
        "along one line",
        "angular vibration is not in a linear test",
        "resonances above the highest frequency are not found",
        "terms beyond the second order weigh otherwise in random vibration than in a sine; two "
        "levels at one frequency are the only guard, and of a resonance that depends on the level "
        "too",
        "the shape of a random vibration at the platform is its profile's: slow samples have it "
        "aliased",
        "profiles that are not stationary, shock and temperature are not in the model",
        "coefficients at one frequency are not flat because nothing contradicts",
        "a resonance of the fixture between accelerometers and gyros is taken for the gyro's"};
    return kStatements;
}

std::string spectrum_text(const SpectrumResult& of) {
    if (!of.several()) return "";
    const Analysis& a = of.analysis;
    std::string text = "\nOver frequency: ";
    for (std::size_t k = 0; k < of.table.kinds().size(); ++k) {
        const Kind& kind = of.table.kinds()[k];
        text += (k > 0 ? ", " : "") + std::to_string(of.table.dwells_of(k)) + " dwells " +
                (kind.profile.empty() ? "at " + line("%.4g Hz", kind.hz()).substr(0, 20)
                                      : "under " + kind.profile);
    }
    std::erase(text, '\n');
    text = "\n" + text + "\n";
    for (const Sweep& sweep : of.sweeps)
        text += line("run %d position %d: sweep from %.4g to %.4g Hz, %zu of %zu seconds used",
                     sweep.run, sweep.position, sweep.blocks.front().from_hz,
                     sweep.blocks.back().to_hz, sweep.known(), sweep.blocks.size());
    if (of.table.kinds().size() > 1)
        text +=
            line("flat: chi-square %.1f of %d, p = %.2g%s", a.flat.chi_square, a.flat.degrees,
                 a.flat.p, a.flat.alarm ? ": quadratic coefficients depend on the frequency" : "");
    for (std::size_t j = 0; j < 3; ++j) {
        if (a.form == Form::groups ||
            (a.form == Form::flat && a.gyros[j].list.size() == 1 && a.gyros[j].log_odds == 0))
            continue;
        const Mixture& gyro = a.gyros[j];
        if (!gyro.resonant()) {
            text += gyro.log_odds < kExcluded
                        ? line("gyro %s: no elastic part (log odds %.1f)", kGyros[j], gyro.log_odds)
                        : line(
                              "gyro %s: an elastic part is neither shown nor excluded (log odds "
                              "%.1f)",
                              kGyros[j], gyro.log_odds);
            continue;
        }
        for (const ResonanceEstimate& one : estimates(gyro))
            text += line(
                "gyro %s: elastic part%s, resonance at %.2f (%.2f, %.2f) Hz, damping "
                "%.4f (%.4f, %.4f)",
                kGyros[j], gyro.named() ? "" : " (not named)", one.hz.mean, one.hz.low, one.hz.high,
                one.damping.mean, one.damping.low, one.damping.high);
    }
    if (!a.model.refusal.empty()) text += "no prediction: " + a.model.refusal + "\n";
    text += of.table.kinds().size() > 1
                ? line(
                      "An elastic part of 20 %% would have been seen up to %.4g Hz; beyond it "
                      "nothing is known.",
                      a.flat.highest_hz)
                : std::string(
                      "Whether they are flat was not tested: dwells at one frequency, and "
                      "what the sweeps tell of a resonance.\n");
    text += "Not shown either:";
    for (const char* one : not_shown()) text += std::string("\n  ") + one;
    return text + "\n";
}

}  // namespace vibrig::tool
