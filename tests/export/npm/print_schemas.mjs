// print_schemas.mjs: prints Foxglove's own JSON Schemas, of @foxglove/schemas, as one object with their names as keys.
import {createRequire} from "node:module";

const schemas = createRequire(import.meta.url)("@foxglove/schemas/jsonschema");
console.log(JSON.stringify(Object.fromEntries(
    Object.values(schemas).filter(({title}) => title?.startsWith("foxglove.")).map((schema) => [schema.title, schema]))));
