// The files of a folder that was dropped or chosen: its name, and [{ path, file }] with paths
// below it.

/** Of what was dropped; null if that is not one folder. */
export async function droppedFolder(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.());
  if (entries.length !== 1 || !entries[0]?.isDirectory) return null;
  const files = [];
  await collect(entries[0], "", files);
  return { name: entries[0].name, files };
}

async function collect(folder, prefix, files) {
  for (const entry of await entriesOf(folder)) {
    const path = `${prefix}${entry.name}`;
    if (entry.isDirectory) {
      await collect(entry, `${path}/`, files);
    } else {
      files.push({ path, file: await new Promise((done, failed) => entry.file(done, failed)) });
    }
  }
}

/** A reader gives a hundred entries at most at a time, and none at the end. */
async function entriesOf(folder) {
  const reader = folder.createReader();
  const all = [];
  for (;;) {
    const some = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (some.length === 0) return all;
    all.push(...some);
  }
}

/** Of an `<input webkitdirectory>`; null if it is empty. */
export function chosenFolder(input) {
  if (input.files.length === 0) return null;
  const split = (file) => file.webkitRelativePath.split("/");
  const [name] = split(input.files[0]);
  const files = [...input.files].map((file) => ({ path: split(file).slice(1).join("/"), file }));
  return { name, files };
}
