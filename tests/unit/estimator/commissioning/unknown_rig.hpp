#pragma once

#include <optional>
#include <vector>

#include "estimator/commissioning/earth.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/plant/random.hpp"

namespace vibrig::estimator::commissioning {

/// A rig of which nobody knows anything: channels, signs, units, zeros, accelerometers, site and
/// drift are drawn. Its kinematics are the simulated rig's.
class UnknownRig {
  public:
    explicit UnknownRig(std::uint64_t seed);

    // what is wrong with it
    std::optional<std::size_t> dead, stuck;
    bool by_hand = false;

    // the truth
    plant::Truth truth;
    std::array<int, 3> channel{};     ///< of outer, inner, azimuth gimbal
    std::array<double, 3> degrees{};  ///< per unit of its reading
    std::array<int, 3> sign{};
    plant::Vec3 zero_deg{};
    plant::Mat3 accelerometers{};  ///< raw = this * platform force + zero_g
    plant::Vec3 zero_g{};
    std::array<int, 3> direction{};  ///< of a commanded travel
    plant::Vec3 travel_deg{130, 30, 175};

    /// To a travel from the start, deg; beyond the limits it is scaled into them, and what is stuck
    /// stays.
    void go(plant::Vec3 travel);
    /// To where the azimuth axis has an upper end.
    void stand_up();
    [[nodiscard]] Stop look(int swept = -1);
    /// `torque`: of the platform in its axes, deg/h.
    [[nodiscard]] FreeDrift drift(const plant::Vec3& torque = {});
    /// The whole sequence of look, moves, sweeps and common positions.
    [[nodiscard]] std::vector<Stop> stops();
    /// Free drift where a description has the gimbals at these angles, as far as it is right.
    [[nodiscard]] std::vector<FreeDrift> drifts(const Description& found);
    /// Gimbal angles in deg, and what would be read there without noise.
    [[nodiscard]] Vec3 reading_at(const plant::Vec3& angle_deg) const;
    [[nodiscard]] Vec3 force_at(const plant::Vec3& angle_deg) const;
    [[nodiscard]] plant::Vec3 angle_deg() const { return angle_deg_; }
    [[nodiscard]] bool right_handed() const { return plant::determinant(accelerometers) > 0; }
    /// Whether the azimuth's reading grows when it turns anticlockwise seen from its upper end.
    [[nodiscard]] bool grows_anticlockwise() const;
    plant::Random random;

  private:
    [[nodiscard]] int whose(std::size_t gimbal) const { return channel[gimbal]; }
    [[nodiscard]] bool hardly_responds(std::size_t gimbal, const plant::Vec3& from);
    plant::PlatformModel model_;
    plant::Vec3 start_deg_{}, angle_deg_{}, asked_{};
};

}  // namespace vibrig::estimator::commissioning
