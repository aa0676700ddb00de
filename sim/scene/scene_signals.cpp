#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

Fields<SignalsDescription::Current> current_fields() {
  using Current = SignalsDescription::Current;
  const auto per_rpm = [](TableReader& reader, Current& current) {
    if (const auto torque = reader.maybe_number("viscous_torque_Nm_per_rpm", non_negative))
      current.viscous_torque = *torque / units::rpm;
  };
  Key viscous = key_of("viscous_torque_Nm_per_rpm", Key::Kind::Number,
                       "torque of the idle spindle that grows with its speed");
  viscous.range = non_negative;
  viscous.fallback = "0";
  return Fields<Current>()
      .number(must("torque_Nm_per_A"), &Current::torque_per_current, positive,
              "torque of the spindle's motor")
      .number("idle_torque_Nm", &Current::idle_torque, non_negative,
              "torque of the idle spindle at any speed")
      .custom({viscous}, per_rpm,
              [](const Current& current, Node::Table& table) {
                put(table, "viscous_torque_Nm_per_rpm",
                    current.viscous_torque * units::rpm / unit_of("viscous_torque_Nm_per_rpm"));
              })
      .number("noise_A", &Current::noise_A, non_negative, "standard deviation of a reading")
      .number("bandwidth_Hz", &Current::bandwidth, non_negative,
              "of the filter, first order; 0: none");
}

Fields<SignalsDescription::Dynamometer> dynamometer_fields() {
  using Dynamometer = SignalsDescription::Dynamometer;
  return Fields<Dynamometer>()
      .number("noise_N", &Dynamometer::noise, non_negative, "standard deviation of a reading")
      .number("resolution_N", &Dynamometer::resolution, non_negative, "0: not rounded")
      .number("bandwidth_Hz", &Dynamometer::bandwidth, non_negative,
              "of the filter, first order; 0: none");
}

}  // namespace

const Fields<SignalsDescription>& signals_fields() {
  using Signals = SignalsDescription;
  static const Fields<Signals> fields =
      Fields<Signals>()
          .number(KeyName("interval_s").otherwise("as fine as 20 000 rows allow"),
                  &Signals::interval, non_negative,
                  "between rows of `signals.csv`, the samples nearest to its multiples")
          .number(KeyName("history_interval_s").otherwise("0: no rows"), &Signals::history_interval,
                  non_negative,
                  "between rows of the thermal history, at most 20 000 more, the axes where the "
                  "program finds them")
          .number("encoder_resolution_um", &Signals::encoder_resolution, non_negative,
                  "of slides; 0: not rounded")
          .number("encoder_resolution_urad", &Signals::encoder_resolution_rad, non_negative,
                  "of axes that turn; 0: not rounded")
          .number("encoder_noise_um", &Signals::encoder_noise, non_negative,
                  "of slides, standard deviation")
          .number("encoder_noise_urad", &Signals::encoder_noise_rad, non_negative,
                  "of axes that turn, standard deviation")
          .table("current", &Signals::current, current_fields(), "current of the spindle's motor")
          .table("dynamometer", &Signals::dynamometer, dynamometer_fields(),
                 "force between part and table");
  return fields;
}

}  // namespace abbe::sim
