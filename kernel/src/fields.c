/* The contents of a snapshot, field by field: the estimator's settings, and the state that a row leaves to the next. What follows from the
 * settings alone is recomputed, so that no padding, no pointer and no derived number is read from bytes. Whoever adds a field to the
 * estimator adds it here: kernel/tests/restore.c compares the objects byte for byte. */
#include "direct.h"
#include "fields.h"

#define ITEMS(T, m, E) (sizeof(((T *)0)->m) / (sizeof(E)))
#define REALS(T, m) {offsetof(T, m), ITEMS(T, m, tg_real), sizeof(tg_real), NULL, 0, 0} /* also a structure of reals alone */
#define DOUBLES(T, m) {offsetof(T, m), ITEMS(T, m, double), sizeof(double), NULL, 0, 0}
#define INTEGERS(T, m, low, high) {offsetof(T, m), ITEMS(T, m, int32_t), sizeof(int32_t), NULL, low, high}
#define ANY(T, m) INTEGERS(T, m, 0, 0) /* of settings, which a new estimator checks */
#define FLAG(T, m) INTEGERS(T, m, 0, 1)
#define INSIDE(T, m, E, fields) {offsetof(T, m), ITEMS(T, m, E), sizeof(E), fields, 0, 0}
#define END {0, 0, 0, NULL, 0, 0}

static const tgi_field machine[] = {ANY(tg_machine, wheels), REALS(tg_machine, mass), REALS(tg_machine, gravity),
                                    REALS(tg_machine, tire_rolling_resistance), REALS(tg_machine, radius), REALS(tg_machine, inertia),
                                    REALS(tg_machine, bearing_resistance), END};

#define T tg_tuning
static const tgi_field tuning[] = {ANY(T, engine), ANY(T, policy), REALS(T, walk), REALS(T, huber), REALS(T, alpha), REALS(T, beta),
                                   REALS(T, kappa), REALS(T, rate), REALS(T, memory), ANY(T, stride), REALS(T, window),
                                   REALS(T, wheel_speed_min), REALS(T, ground_speed_min), ANY(T, supervisor), REALS(T, scales),
                                   REALS(T, dwell), ANY(T, mix_stride), END};
#undef T
#define T tg_settings
const tgi_field tgi_settings_fields[] = {
    ANY(T, method), ANY(T, axles), ANY(T, towing), ANY(T, weighed), ANY(T, carrying), ANY(T, articulated), ANY(T, pivots), ANY(T, wheel_axle), ANY(T, driven), ANY(T, powered),
    INSIDE(T, machine, tg_machine, machine), INSIDE(T, tuning, tg_tuning, tuning), REALS(T, load_share), REALS(T, load_transfer),
    REALS(T, payload_share), REALS(T, payload_height), REALS(T, hitch_share),
    REALS(T, wheel_share), REALS(T, wheel_side), REALS(T, wheel_ahead), REALS(T, receiver_ahead), REALS(T, receiver_side), REALS(T, lateral_share), REALS(T, center_of_gravity_height), REALS(T, hitch_height),
    REALS(T, rolling_radius), REALS(T, drive_friction), REALS(T, offset), REALS(T, gain), REALS(T, noise), REALS(T, held_period), REALS(T, ground_speed_delay), REALS(T, uncertainty),
    REALS(T, prior_adhesion), REALS(T, prior_adhesion_std), REALS(T, prior_resistance), REALS(T, prior_resistance_std), REALS(T, slope_spread),
    REALS(T, standstill_speed), REALS(T, dead_band), REALS(T, gap), REALS(T, max_step), REALS(T, outlier_weight), REALS(T, load_filter),
    REALS(T, algebraic_filter), REALS(T, watch), REALS(T, tuned), END};
#undef T
#define T tg_hold
static const tgi_field hold[] = {REALS(T, value), REALS(T, variance), REALS(T, raw), REALS(T, calm),
                                 REALS(T, level), REALS(T, rate), REALS(T, bend), REALS(T, bends), REALS(T, interval), REALS(T, spike), DOUBLES(T, time), DOUBLES(T, since),
                                 INTEGERS(T, count, 0, 100), END};
#undef T
static const tgi_field own_time[] = {DOUBLES(tgi_own_time, until), DOUBLES(tgi_own_time, torque), REALS(tgi_own_time, step), REALS(tgi_own_time, hub), END};
static const tgi_field lowpass[] = {REALS(tg_lowpass, value), DOUBLES(tg_lowpass, time), FLAG(tg_lowpass, seen), END};
static const tgi_field settling[] = {REALS(tgi_settling, settled), REALS(tgi_settling, soon), DOUBLES(tgi_settling, time), FLAG(tgi_settling, seen), END};

#define T tgi_slope
static const tgi_field slope[] = {REALS(T, speed), REALS(T, error), REALS(T, speed_variance), REALS(T, covariance), REALS(T, error_variance),
                                  REALS(T, acceleration), FLAG(T, running), END};
#undef T
#define T tg_belief
static const tgi_field belief[] = {REALS(T, x), REALS(T, P), INTEGERS(T, channels, 0, TG_MAX_CHANNELS), REALS(T, nis), REALS(T, supervisor), END};
#undef T
#define T tg_algebra
static const tgi_field algebra[] = {INSIDE(T, wheel, tg_lowpass, lowpass), INSIDE(T, ground, tg_lowpass, lowpass),
                                    INSIDE(T, torque, tg_lowpass, lowpass), INSIDE(T, drawbar, tg_lowpass, lowpass), REALS(T, wheel_rate),
                                    REALS(T, ground_rate), REALS(T, gain), END};
#undef T
#define T tgi_digging
static const tgi_field digging[] = {REALS(T, sum), REALS(T, rows), REALS(T, now), REALS(T, mean), REALS(T, usual), REALS(T, age),
                                    REALS(T, points), REALS(T, score), DOUBLES(T, time), FLAG(T, moving), FLAG(T, slips), END};
#undef T
#define T tgi_watch
static const tgi_field watch[] = {INSIDE(T, digging, tgi_digging, digging), REALS(T, rim), REALS(T, spinning), REALS(T, pushed), REALS(T, turned),
                                  DOUBLES(T, stuck_time), FLAG(T, turning), FLAG(T, held), FLAG(T, sinking), FLAG(T, stuck), FLAG(T, pushing),
                                  END};
#undef T
#define T tg_supervisor_state
static const tgi_field supervisor[] = {REALS(T, value), DOUBLES(T, time), REALS(T, last), INTEGERS(T, first, 0, TG_SNAPSHOTS - 1), INTEGERS(T, count, 0, TG_SNAPSHOTS),
                                       REALS(T, gamma), END};
#undef T
#define T tg_filter
static const tgi_field filter[] = {
    DOUBLES(T, clock), REALS(T, slope), REALS(T, cosine), REALS(T, sine), REALS(T, x), REALS(T, d), REALS(T, u), REALS(T, P), FLAG(T, formed),
    INTEGERS(T, factor_steps, 0, TGI_FACTOR_STEPS), REALS(T, x_prior), REALS(T, passage), INTEGERS(T, used, 0, TG_MAX_CHANNELS),
    INTEGERS(T, channel, 0, TG_MAX_CHANNELS - 1), REALS(T, gain), REALS(T, accelerometer), END};
#undef T
#define T tg_adaptation_state
static const tgi_field adaptation[] = {REALS(T, scale), REALS(T, dx), REALS(T, dP), REALS(T, C), INTEGERS(T, updates, 0, INT32_MAX - 1), END};
#undef T
#define T tg_bank_state
static const tgi_field bank[] = {REALS(T, x), REALS(T, d), REALS(T, u), REALS(T, gain), REALS(T, probability), DOUBLES(T, mixed),
                                INTEGERS(T, updates, 0, INT32_MAX - 1), END};
#undef T
#define T tg_filter
#define ADAPTATION INSIDE(T, policy.adaptive.adaptation, tg_adaptation_state, adaptation)
const tgi_field tgi_policy_fields[][3] = {[TG_FIXED] = {END},
                                          [TG_ADAPTIVE] = {ADAPTATION, END},
                                          [TG_SUPERVISED] = {ADAPTATION, INSIDE(T, policy.adaptive.supervisor, tg_supervisor_state, supervisor), END},
                                          [TG_BANK] = {INSIDE(T, policy.bank, tg_bank_state, bank), END}};
#undef T
static const tgi_field consider[] = {REALS(tg_consider, s), REALS(tg_consider, prior), END};

#define T tg_estimator
#define HOLDS(m) INSIDE(T, m, tg_hold, hold)
#define LOWPASS(m) INSIDE(T, m, tg_lowpass, lowpass)
const tgi_field tgi_estimator_fields[] = {
    REALS(T, deviations), FLAG(T, started), FLAG(T, seen_motion), FLAG(T, standing), FLAG(T, by_torque), INTEGERS(T, direction, -1, 1), DOUBLES(T, time),
    DOUBLES(T, measured_time), DOUBLES(T, distance), REALS(T, last_raw), DOUBLES(T, last_raw_time), HOLDS(torque), HOLDS(drawbar), HOLDS(pitch),
    HOLDS(axle_load), HOLDS(mass), HOLDS(hitch_load), HOLDS(wheel), HOLDS(ground), HOLDS(forward), HOLDS(turn), INSIDE(T, own_time, tgi_own_time, own_time), INTEGERS(T, rolls, 0, 255), INTEGERS(T, shared, 0, 8), INTEGERS(T, locked, 0, 8), INTEGERS(T, unseen, 0, 3),
    FLAG(T, braked), FLAG(T, pressed), REALS(T, unbraked), DOUBLES(T, unbraked_time), DOUBLES(T, braked_time),
    REALS(T, yaw_rate), DOUBLES(T, yaw_time), REALS(T, unseen_turn), DOUBLES(T, leap_time), INSIDE(T, settling, tgi_settling, settling),
    LOWPASS(acceleration), LOWPASS(lateral), LOWPASS(roll), LOWPASS(balance), REALS(T, slip_memory), INSIDE(T, slope, tgi_slope, slope), REALS(T, roughness), REALS(T, warped), REALS(T, hidden), REALS(T, slow_speed), REALS(T, loudness),
    DOUBLES(T, ground_time), REALS(T, shock),
    REALS(T, held), INSIDE(T, belief, tg_belief, belief), INSIDE(T, algebra, tg_algebra, algebra), INSIDE(T, watch, tgi_watch, watch),
    REALS(T, scene), REALS(T, curve), REALS(T, wheel_curve), REALS(T, curve_std), REALS(T, wheel_curve_std), REALS(T, curve_wait),
    REALS(T, curve_distance), REALS(T, speeds), REALS(T, speed_mode), INSIDE(T, consider, tg_consider, consider),
    INSIDE(T, filter, tg_filter, filter), END};
#undef T

size_t tgi_fields_size(const tgi_field *fields)
{
    size_t size = 0;
    for (; fields->count; fields++) size += fields->count * (fields->inside ? tgi_fields_size(fields->inside) : fields->size);
    return size;
}

uint8_t *tgi_write_fields(const tgi_field *fields, const void *object, uint8_t *bytes)
{
    for (; fields->count; fields++) {
        const char *from = (const char *)object + fields->offset;
        if (fields->inside)
            for (size_t k = 0; k < fields->count; k++) bytes = tgi_write_fields(fields->inside, from + k * fields->size, bytes);
        else {
            memcpy(bytes, from, fields->count * fields->size);
            bytes += fields->count * fields->size;
        }
    }
    return bytes;
}

int tgi_fields_are_sound(const tgi_field *fields, const uint8_t *bytes)
{
    for (; fields->count; fields++) {
        const size_t size = fields->inside ? tgi_fields_size(fields->inside) : fields->size;
        for (size_t k = 0; k < fields->count; k++, bytes += size) {
            int32_t value = 0;
            if (fields->inside && !tgi_fields_are_sound(fields->inside, bytes)) return 0;
            if (fields->low < fields->high) memcpy(&value, bytes, sizeof value);
            if (value < fields->low || value > fields->high) return 0;
        }
    }
    return 1;
}

const uint8_t *tgi_read_fields(const tgi_field *fields, void *object, const uint8_t *bytes)
{
    for (; fields->count; fields++) {
        char *const to = (char *)object + fields->offset;
        if (fields->inside)
            for (size_t k = 0; k < fields->count; k++) bytes = tgi_read_fields(fields->inside, to + k * fields->size, bytes);
        else {
            memcpy(to, bytes, fields->count * fields->size);
            bytes += fields->count * fields->size;
        }
    }
    return bytes;
}
