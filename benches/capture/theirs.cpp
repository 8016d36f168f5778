// Other people's orientation filters over a recording, each called once per sample and read out:
// VQF of its authors (C++, double) and x-io Fusion (C, float).
//
// Arguments: filter (vqf, fusion), axes (6, 9), sampling rate in Hz, input, output.
// Input: little-endian doubles, per sample angular rate x y z in rad/s, specific force x y z in m/s2,
// magnetic field x y z (NaN: none). Output: doubles, quaternion w x y z per sample, world east, north,
// up. Printed: ns per sample, the best of five runs.
//
// Fusion is set as the advanced example of its authors sets it: gain 0.5, rejection of 10 degrees
// for at most 5 s, and its own bias estimator.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "vqf.hpp"
extern "C" {
#include "Fusion.h"
}

static const float DEGREES = 57.29577951f;
static const float G = 9.80665f;

static FusionVector scaled(const double *v, float by) {
    FusionVector out;
    out.axis.x = float(v[0]) * by;
    out.axis.y = float(v[1]) * by;
    out.axis.z = float(v[2]) * by;
    return out;
}

static void vqf(bool nine, double rate_hz, const std::vector<double> &in, std::vector<double> &out) {
    VQF filter(1.0 / rate_hz);
    for (size_t n = 0; n < in.size() / 9; n++) {
        const double *row = &in[9 * n];
        if (nine && !std::isnan(row[6])) {
            filter.update(row, row + 3, row + 6);
        } else {
            filter.update(row, row + 3);
        }
        nine ? filter.getQuat9D(&out[4 * n]) : filter.getQuat6D(&out[4 * n]);
    }
}

static void fusion(bool nine, double rate_hz, const std::vector<double> &in, std::vector<double> &out) {
    FusionBias bias;
    FusionBiasInitialise(&bias);
    FusionBiasSettings bias_settings = fusionBiasDefaultSettings;
    bias_settings.sampleRate = float(rate_hz);
    FusionBiasSetSettings(&bias, &bias_settings);
    FusionAhrs ahrs;
    FusionAhrsInitialise(&ahrs);
    FusionAhrsSettings settings = fusionAhrsDefaultSettings;
    settings.sampleRate = float(rate_hz);
    settings.convention = FusionConventionEnu;
    settings.gain = 0.5f;
    settings.gyroscopeRange = 2000.0f;
    settings.accelerationRejection = 10.0f;
    settings.magneticRejection = 10.0f;
    settings.rejectionTimeout = 5.0f;
    FusionAhrsSetSettings(&ahrs, &settings);
    for (size_t n = 0; n < in.size() / 9; n++) {
        const double *row = &in[9 * n];
        FusionVector rate = FusionBiasUpdate(&bias, scaled(row, DEGREES));
        FusionVector force = scaled(row + 3, 1.0f / G);
        if (nine && !std::isnan(row[6])) {
            FusionAhrsUpdate(&ahrs, rate, force, scaled(row + 6, 1.0f));
        } else {
            FusionAhrsUpdateNoMagnetometer(&ahrs, rate, force);
        }
        FusionQuaternion q = FusionAhrsGetQuaternion(&ahrs);
        double *to = &out[4 * n];
        to[0] = q.element.w;
        to[1] = q.element.x;
        to[2] = q.element.y;
        to[3] = q.element.z;
    }
}

int main(int count, char **arguments) {
    if (count != 6) {
        return 2;
    }
    bool nine = arguments[2][0] == '9';
    auto run = std::strcmp(arguments[1], "vqf") == 0 ? vqf : fusion;
    double rate_hz = std::atof(arguments[3]);
    std::FILE *file = std::fopen(arguments[4], "rb");
    if (!file) {
        return 1;
    }
    std::fseek(file, 0, SEEK_END);
    std::vector<double> in(size_t(std::ftell(file)) / sizeof(double));
    std::rewind(file);
    bool read = std::fread(in.data(), sizeof(double), in.size(), file) == in.size();
    std::fclose(file);
    if (!read || in.size() < 9) {
        return 1;
    }
    std::vector<double> out(in.size() / 9 * 4);
    double best = INFINITY;
    for (int round = 0; round < 5; round++) {
        auto began = std::chrono::steady_clock::now();
        run(nine, rate_hz, in, out);
        std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
        best = std::fmin(best, took.count());
    }
    file = std::fopen(arguments[5], "wb");
    if (!file || std::fwrite(out.data(), sizeof(double), out.size(), file) != out.size()) {
        return 1;
    }
    std::fclose(file);
    std::printf("%f\n", best / double(in.size() / 9) * 1e9);
    return 0;
}
