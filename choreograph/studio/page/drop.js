// Files dropped anywhere on the page: a song, a character, or takes to build a repertoire from.

const SONGS = /\.(mp3|wav|flac|ogg|opus|m4a|aac|aif|aiff|mp4)$/i;
const CHARACTERS = /\.(glb|vrm|gltf)$/i;

export class Drop {
  // send: { song(file), character(file), takes(files) }
  constructor(send) {
    this.send = send;
    this.depth = 0;
    const veil = document.getElementById("drop-veil");
    const holdsFiles = (event) => event.dataTransfer?.types.includes("Files");
    addEventListener("dragenter", (event) => { if (holdsFiles(event)) { this.depth += 1; veil.hidden = false; } });
    addEventListener("dragleave", (event) => { if (holdsFiles(event) && --this.depth <= 0) veil.hidden = true; });
    addEventListener("dragover", (event) => { if (holdsFiles(event)) event.preventDefault(); });
    addEventListener("drop", async (event) => {
      this.depth = 0;
      veil.hidden = true;
      if (!holdsFiles(event)) return;
      event.preventDefault();
      this.take(await filesOf(event.dataTransfer));
    });
  }

  // One song, one character, or anything else as takes.
  take(files) {
    if (!files.length) return;
    const [first] = files;
    if (files.length === 1 && SONGS.test(first.name)) this.send.song(first);
    else if (files.length === 1 && CHARACTERS.test(first.name)) this.send.character(first);
    else this.send.takes(files);
  }
}

// The files of a drop, those of folders included.
async function filesOf(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...transfer.files];
  return (await Promise.all(entries.map(walk))).flat();
}

async function walk(entry) {
  if (entry.isFile) return [await new Promise((got, lost) => entry.file(got, lost))];
  const reader = entry.createReader(), found = [];
  for (;;) {
    const some = await new Promise((got, lost) => reader.readEntries(got, lost));
    if (!some.length) break;
    found.push(...(await Promise.all(some.map(walk))).flat());
  }
  return found;
}
