// Reads MCAP files with the reference reader, and every message with the published schema of its name; what is wrong is printed
// and ends in exit code 1.
const { readFileSync } = require('fs');
const { McapIndexedReader, TempBuffer } = require('@mcap/core');
const published = require('@foxglove/schemas/jsonschema');
const Ajv = require('ajv');

const ajv = new Ajv({ strict: false, validateFormats: false });

async function check(file) {
  const bytes = readFileSync(file);
  const reader = await McapIndexedReader.Initialize({ readable: new TempBuffer(bytes) });
  const text = new TextDecoder();
  const checks = new Map();
  for (const [id, { name, encoding, data }] of reader.schemasById) {
    const [, own] = name.match(/^foxglove\.(\w+)$/) ?? [];
    if (encoding !== 'jsonschema' || !published[own]) throw new Error(`schema ${name} is not published`);
    checks.set(id, [ajv.compile(published[own]), ajv.compile(JSON.parse(text.decode(data)))]);
  }
  let count = 0;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const { topic, schemaId, messageEncoding } = reader.channelsById.get(message.channelId);
    if (messageEncoding !== 'json') throw new Error(`${topic}: ${messageEncoding}`);
    for (const valid of checks.get(schemaId)) {
      if (!valid(JSON.parse(text.decode(message.data)))) throw new Error(`${topic}: ${ajv.errorsText(valid.errors)}`);
    }
    count += 1;
  }
  const promised = Number(reader.statistics.messageCount);
  if (count === 0 || count !== promised) throw new Error(`${count} messages of ${promised}`);
}

for (const file of process.argv.slice(2)) {
  check(file).catch((error) => {
    console.log(`${file}: ${error.message}`);
    process.exitCode = 1;
  });
}
