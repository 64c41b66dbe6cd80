/* An estimator as bytes: a header that identifies them, the settings, the state field by field (fields.c), a checksum. A
 * checksum is no signature: what is restored may be anything, so its settings are checked as new ones are, and every count and index
 * against its range. */
#include "fields.h"

#define TG_SNAPSHOT_VERSION 42u

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order; /* 1 as this machine writes it */
    uint32_t real_size;
    uint32_t size;       /* of all fields of any policy: changes with them */
} tg_snapshot_header;

static tg_snapshot_header header_of_this_kernel(void)
{
    const size_t size = tgi_fields_size(tgi_settings_fields) + tgi_fields_size(tgi_estimator_fields) +
                        tgi_fields_size(tgi_policy_fields[TG_SUPERVISED]) + tgi_fields_size(tgi_policy_fields[TG_BANK]);
    const tg_snapshot_header h = {"TERRAGR", TG_SNAPSHOT_VERSION, 1u, (uint32_t)sizeof(tg_real), (uint32_t)size};
    return h;
}

static size_t size_of(const tg_settings *s)
{
    return sizeof(tg_snapshot_header) + tgi_fields_size(tgi_settings_fields) + tgi_fields_size(tgi_estimator_fields) +
           tgi_fields_size(tgi_policy_fields[s->tuning.policy]) + sizeof(uint64_t);
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
    to = tgi_write_fields(tgi_policy_fields[e->settings.tuning.policy], &e->filter, to);
    const uint64_t hash = checksum(bytes, (size_t)(to - bytes));
    memcpy(to, &hash, sizeof hash);
    return TG_OK;
}

tg_status tg_estimator_restore(tg_estimator *e, size_t room, const uint8_t *bytes, size_t size)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    const tg_snapshot_header header = header_of_this_kernel();
    tg_settings settings;
    uint64_t hash;
    if (size < sizeof header + tgi_fields_size(tgi_settings_fields) || memcmp(bytes, &header, sizeof header) != 0) return TG_BAD_SNAPSHOT;
    memset(&settings, 0, sizeof settings);
    const uint8_t *const from = tgi_read_fields(tgi_settings_fields, &settings, bytes + sizeof header);
    const size_t object = tg_estimator_size(settings.tuning.policy);
    if (!object || size != size_of(&settings)) return TG_BAD_SNAPSHOT;
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    const tgi_field *const policy = tgi_policy_fields[settings.tuning.policy];
    const uint8_t *const behind = from + tgi_fields_size(tgi_estimator_fields);
    if (hash != checksum(bytes, size - sizeof hash) || !tgi_fields_are_sound(tgi_estimator_fields, from) || !tgi_fields_are_sound(policy, behind))
        return TG_BAD_SNAPSHOT;
    if (room < object) return TG_BAD_ARGUMENT;
    if (tg_estimator_init(e, &settings) != TG_OK) return TG_BAD_SNAPSHOT; /* nothing can fail from here on */
    tgi_read_fields(tgi_estimator_fields, e, from);
    e->direction = e->direction < 0 ? -1 : 1; /* 0 is within its range, and neither */
    tgi_read_fields(policy, &e->filter, behind);
    return TG_OK;
}
