// The JSON Schema of summary.json.
#pragma once

namespace ballast::sweep {

extern const char* const kSummarySchema;

}  // namespace ballast::sweep
