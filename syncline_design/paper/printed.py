"""Figures as the Syncline paper prints them, for `reproduce` to compare with.

Source: E. R. Jellum, T. H. Bryne, T. A. Johansen, M. Orlandić, "The Syncline Model: Analyzing the
Impact of Time Synchronization in Sensor Fusion", arXiv:2209.01136v2 (CC BY 4.0).  Digits and unit
of each figure are the paper's (a space is put before the unit).  This is no catalog: nothing here
enters a design.  Ids are those of the catalogs; where the paper contradicts itself is listed in
`paper_errata`.
"""

from __future__ import annotations

from collections.abc import Mapping

Table = Mapping[str, Mapping[str, str]]  # row -> column -> figure as printed

# fmt: off
PRINTED: Mapping[str, Table] = {
    "platforms": {  # tab:examples
        "uav_fixed_wing": {
            "v_max": "21 m/s", "omega_max": "77.9 deg/s", "distance": "100 m",
            "baseline": "1 m",
        },
        "uav_multi_rotor": {
            "v_max": "5 m/s", "omega_max": "311.8 deg/s", "distance": "5 m",
            "baseline": "0.5 m",
        },
        "usv": {"v_max": "5 m/s", "omega_max": "17 deg/s", "distance": "30 m", "baseline": "5 m"},
        "auv": {"v_max": "30 m/s", "omega_max": "8.7 deg/s", "distance": "5 m", "baseline": "5 m"},
        "car": {
            "v_max": "30 m/s", "omega_max": "17.3 deg/s", "distance": "50 m",
            "baseline": "3 m",
        },
        "large_sv": {
            "v_max": "2.5 m/s", "omega_max": "4.5 deg/s", "distance": "1000 m",
            "baseline": "50 m",
        },
        "small_sv": {
            "v_max": "4 m/s", "omega_max": "17 deg/s", "distance": "1000 m",
            "baseline": "10 m",
        },
    },
    "sensors": {  # tab:sensor_accuracy, one sigma
        "ublox_f9p_pvt": {"position": "1.5 m"},
        "ublox_f9p_rtk": {"position": "1 cm"},
        "trimble_r12_dgnss": {"position": "0.25 m"},
        "trimble_r12_rtk": {"position": "8 mm"},
        "sbg_ellipse": {"roll": "0.1 deg", "pitch": "0.1 deg", "yaw": "0.2 deg"},
        "sbg_apogee": {"roll": "0.008 deg", "pitch": "0.008 deg", "yaw": "0.03 deg"},
        "kongsberg_mru5": {"roll": "0.002 deg", "pitch": "0.002 deg", "yaw": "0.002 deg"},
        "velodyne_alpha_prime": {"range": "4 cm", "azimuth": "0.1 deg", "elevation": "0.2 deg"},
        "velodyne_hdl32e": {"range": "2 cm", "azimuth": "0.08 deg", "elevation": "0.08 deg"},
        "riegl_vux1uav": {"range": "1 cm", "azimuth": "0.006 deg", "elevation": "0.006 deg"},
        "faro_focus_plus": {"range": "1 mm", "azimuth": "0.005 deg", "elevation": "0.005 deg"},
        "kongsberg_hipap502": {"range": "2 cm", "azimuth": "0.06 deg", "elevation": "0.06 deg"},
        "sonardyne_usbl7000": {"range": "1.5 cm", "azimuth": "0.04 deg", "elevation": "0.04 deg"},
        "kongsberg_m3": {"range": "1 cm", "azimuth": "0.9 deg", "elevation": "0.5 deg"},
        "r2sonic_2026": {"range": "1 mm", "azimuth": "0.45 deg", "elevation": "0.45 deg"},
    },
    "tau_crit_georeferencing": {  # tab:georef_tau
        "ublox_f9p_pvt": {
            "usv": "520 ms", "car": "86 ms", "uav_multi_rotor": "520 ms",
            "uav_fixed_wing": "123 ms",
        },
        "ublox_f9p_rtk": {
            "usv": "3 ms", "car": "577 us", "uav_multi_rotor": "3 ms",
            "uav_fixed_wing": "824 us",
        },
        "sbg_ellipse": {
            "usv": "9 ms", "car": "4 ms", "uav_multi_rotor": "663 us",
            "uav_fixed_wing": "2 ms",
        },
        "kongsberg_mru5": {
            "usv": "130 us", "car": "67 us", "uav_multi_rotor": "9 us",
            "uav_fixed_wing": "38 us",
        },
        "velodyne_alpha_prime": {
            "usv": "11 ms", "car": "5 ms", "uav_multi_rotor": "2 ms",
            "uav_fixed_wing": "3 ms",
        },
        "riegl_vux1uav": {
            "usv": "1 ms", "car": "385 us", "uav_multi_rotor": "333 us",
            "uav_fixed_wing": "157 us",
        },
    },
    "tau_crit_survey": {  # tab:survey_tau
        "ublox_f9p_pvt": {"large_sv": "1039.230 ms", "small_sv": "649.519 ms"},
        "ublox_f9p_rtk": {"large_sv": "6.928 ms", "small_sv": "4.330 ms"},
        "sbg_ellipse": {"large_sv": "52.754 ms", "small_sv": "14.217 ms", "auv": "19.335 ms"},
        "kongsberg_mru5": {"large_sv": "0.746 ms", "small_sv": "0.201 ms", "auv": "0.273 ms"},
        "kongsberg_hipap502": {"large_sv": "18.521 ms", "small_sv": "4.991 ms", "auv": "9.713 ms"},
        "sonardyne_usbl7000": {"large_sv": "12.368 ms", "small_sv": "3.333 ms", "auv": "6.727 ms"},
        "r2sonic_2026": {"large_sv": "137.071 ms", "small_sv": "36.940 ms", "auv": "50.385 ms"},
        "kongsberg_m3": {"large_sv": "221.857 ms", "small_sv": "59.790 ms", "auv": "82.776 ms"},
    },
    "text": {  # on fig:syncline-survey (one roof for both vessels) and fig:sync-line
        "survey_tau_crit": {"large_sv": "16 ms", "small_sv": "4 ms"},
        "survey_roof": {"both_sv": "1.67 m"},
        "figure_1_asymptote": {"car": "10 1/m"},
    },
}
# fmt: on
