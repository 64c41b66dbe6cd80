/* An estimator as bytes: a header that identifies them, the settings, the state field by field (fields.c), a checksum. A
 * checksum is no signature: what is restored may be anything, so its settings are checked as new ones are, and every count and index
 * against its range. */
#include "fields.h"
#include <limits.h>

#define TG_SNAPSHOT_VERSION 22u

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order; /* 1 as this machine writes it */
    uint32_t real_size;
    uint32_t size;       /* of all fields of any policy: changes with them */
} tg_snapshot_header;

static tg_snapshot_header header_of_this_kernel(void)
{
    const size_t size = tgi_fields_size(tgi_settings_fields) + tgi_fields_size(tgi_estimator_fields) + tgi_fields_size(tgi_filter_fields) +
                        tgi_fields_size(tgi_policy_fields[TG_SUPERVISED]) + tgi_fields_size(tgi_policy_fields[TG_BANK]) +
                        tgi_fields_size(tgi_consider_fields);
    const tg_snapshot_header h = {"TERRAGR", TG_SNAPSHOT_VERSION, 1u, (uint32_t)sizeof(tg_real), (uint32_t)size};
    return h;
}

static size_t size_of(const tg_settings *s)
{
    return sizeof(tg_snapshot_header) + tgi_fields_size(tgi_settings_fields) + tgi_fields_size(tgi_estimator_fields) +
           tgi_fields_size(tgi_filter_fields) + tgi_fields_size(tgi_policy_fields[s->tuning.policy]) + tgi_fields_size(tgi_consider_fields) + sizeof(uint64_t);
}

/* FNV-1a, 64 bits. */
static uint64_t checksum(const uint8_t *bytes, size_t size)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t k = 0; k < size; k++) hash = (hash ^ bytes[k]) * 1099511628211u;
    return hash;
}

size_t tg_snapshot_size(const tg_estimator *e)
{
    return e ? size_of(&e->settings) : 0;
}

tg_status tg_estimator_snapshot(const tg_estimator *e, uint8_t *bytes)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    const tg_snapshot_header header = header_of_this_kernel();
    uint8_t *to = bytes + sizeof header;
    memcpy(bytes, &header, sizeof header);
    to = tgi_write_fields(tgi_settings_fields, &e->settings, to);
    to = tgi_write_fields(tgi_estimator_fields, e, to);
    to = tgi_write_fields(tgi_filter_fields, &e->filter, to);
    to = tgi_write_fields(tgi_policy_fields[e->settings.tuning.policy], &e->filter, to);
    to = tgi_write_fields(tgi_consider_fields, &e->consider, to);
    const uint64_t hash = checksum(bytes, (size_t)(to - bytes));
    memcpy(to, &hash, sizeof hash);
    return TG_OK;
}

static int is_within(int32_t x, int32_t low, int32_t high)
{
    return x >= low && x <= high;
}

/* What the filter counts and indexes by. */
static int filter_is_sound(const tg_filter *f)
{
    if (!is_within(f->used, 0, f->channels) || !is_within(f->formed, 0, 1) || !is_within(f->factor_steps, 0, 1000)) return 0;
    for (int32_t c = 0; c < f->used; c++)
        if (!is_within(f->channel[c], 0, f->channels - 1)) return 0;
    if (f->tuning.policy == TG_FIXED) return 1;
    if (f->tuning.policy == TG_BANK) return is_within(f->policy.bank.updates, 0, INT_MAX / 2);
    const tg_supervisor_state *const s = &f->policy.adaptive.supervisor;
    if (f->tuning.policy == TG_SUPERVISED && !(is_within(s->count, 0, TG_SNAPSHOTS) && is_within(s->first, 0, TG_SNAPSHOTS - 1))) return 0;
    return is_within(f->policy.adaptive.adaptation.updates, 0, INT_MAX / 2);
}

static int is_sound(const tg_estimator *e)
{
    return filter_is_sound(&e->filter) && (e->direction == 1 || e->direction == -1) && is_within(e->started, 0, 1) &&
           is_within(e->seen_motion, 0, 1) && is_within(e->standing, 0, 1);
}

tg_status tg_estimator_restore(tg_estimator *e, size_t room, const uint8_t *bytes, size_t size)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    const tg_snapshot_header header = header_of_this_kernel();
    tg_settings settings;
    tg_estimator found;
    uint64_t hash;
    if (size < sizeof header + tgi_fields_size(tgi_settings_fields) || memcmp(bytes, &header, sizeof header) != 0) return TG_BAD_SNAPSHOT;
    memset(&settings, 0, sizeof settings);
    const uint8_t *from = tgi_read_fields(tgi_settings_fields, &settings, bytes + sizeof header);
    const size_t object = tg_estimator_size(settings.tuning.policy);
    if (!object || size != size_of(&settings)) return TG_BAD_SNAPSHOT;
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    if (hash != checksum(bytes, size - sizeof hash) || tg_estimator_init(&found, &settings) != TG_OK) return TG_BAD_SNAPSHOT;
    from = tgi_read_fields(tgi_estimator_fields, &found, from);
    from = tgi_read_fields(tgi_filter_fields, &found.filter, from);
    from = tgi_read_fields(tgi_policy_fields[settings.tuning.policy], &found.filter, from);
    tgi_read_fields(tgi_consider_fields, &found.consider, from);
    if (!is_sound(&found)) return TG_BAD_SNAPSHOT;
    if (room < object) return TG_BAD_ARGUMENT;
    memcpy(e, &found, object);
    return TG_OK;
}
