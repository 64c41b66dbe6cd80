/* A machine of four wheels with every method, and samples of it driving: what the tests of snapshots and the fuzzers share. */
#ifndef DRIVEN_H
#define DRIVEN_H
#include "check.h"

enum { METHODS = 6 };

static const int32_t methods[METHODS][3] = {{TG_EXACT, TG_FIXED, TG_FILTERED},          {TG_EXACT, TG_BANK, TG_FILTERED},
                                            {TG_UNSCENTED, TG_ADAPTIVE, TG_FILTERED}, {TG_UNSCENTED, TG_SUPERVISED, TG_FILTERED},
                                            {TG_EXACT, TG_FIXED, TG_ALGEBRAIC},       {TG_EXACT, TG_FIXED, TG_SPEEDS}};

static inline tg_settings settings_of(int method)
{
    tg_settings s = tg_default_settings();
    s.machine = random_machine(4);
    s.axles = 2;
    s.tuning.engine = methods[method][0];
    s.tuning.policy = methods[method][1];
    s.method = methods[method][2];
    s.towing = 1;
    s.held_period[TG_GROUND_SPEED] = (tg_real)0.02;
    for (int i = 0; i < 4; i++) {
        s.wheel_axle[i] = i / 2;
        s.driven[i] = 1;
        s.powered[i] = i < 2;
        s.wheel_share[i] = (tg_real)0.5;
        s.rolling_radius[i] = s.machine.radius[i];
    }
    s.load_share[0] = s.load_share[1] = (tg_real)0.5;
    for (int k = 0; k < TG_SLOTS; k++) s.noise[k] = (tg_real)0.05;
    s.uncertainty.drive_torque_gain = s.uncertainty.slope = (tg_real)0.02;
    CHECK(tg_tune_walks(&s) == TG_OK, "walks");
    return s;
}

/* The time is the caller's. */
static inline tg_sample sample_of(int row)
{
    tg_sample sample;
    const double moves = row < 20 ? 0 : 1; /* from a standstill */
    for (int k = 0; k < TG_SLOTS; k++) sample.value[k] = (tg_real)NAN;
    for (int i = 0; i < 4; i++) {
        sample.value[TG_WHEEL_SPEED + i] = (tg_real)(moves * 4 + 0.05 * moves * normal());
        sample.value[TG_DRIVE_TORQUE + i] = (tg_real)(20 + normal());
    }
    for (int k = 0; k < 2; k++) sample.value[TG_VERTICAL_LOAD + k] = (tg_real)(500 + 5 * normal());
    sample.value[TG_DRAWBAR_FORCE] = (tg_real)(50 + normal());
    sample.value[TG_ACCELERATION_X] = (tg_real)(0.1 * normal());
    sample.value[TG_ACCELERATION_Y] = (tg_real)(0.1 * normal());
    sample.value[TG_PITCH] = (tg_real)(0.01 * normal());
    sample.value[TG_YAW_RATE] = (tg_real)(0.01 * normal());
    if (row % 7) sample.value[TG_GROUND_SPEED] = (tg_real)(moves * 0.7 + 0.02 * moves * normal());
    sample.time = 0;
    return sample;
}

/* The checksum behind a snapshot (FNV-1a, 64 bits) made to fit what stands before it. */
static inline void seal_snapshot(uint8_t *bytes, size_t size)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t k = 0; k < size - sizeof hash; k++) hash = (hash ^ bytes[k]) * 1099511628211u;
    memcpy(bytes + size - sizeof hash, &hash, sizeof hash);
}
#endif
