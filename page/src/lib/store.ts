/** Photos and the session in IndexedDB, so that nothing is lost by a reload or when the server was started again. */

const NAME = "subtense";
const STORES = ["photos", "session"] as const;
type Store = (typeof STORES)[number];

let opened: Promise<IDBDatabase> | null = null;

function open(): Promise<IDBDatabase> {
  opened ??= new Promise((resolve, reject) => {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => {
      for (const store of STORES) request.result.createObjectStore(store);
    };
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
  return opened;
}

async function run<T>(store: Store, mode: IDBTransactionMode, work: (store: IDBObjectStore) => IDBRequest<T>): Promise<T | undefined> {
  try {
    const db = await open();
    return await new Promise<T>((resolve, reject) => {
      const transaction = db.transaction(store, mode);
      const request = work(transaction.objectStore(store));
      transaction.oncomplete = () => resolve(request.result);
      transaction.onerror = () => reject(transaction.error);
      transaction.onabort = () => reject(transaction.error);
    });
  } catch {
    return undefined; // private windows may have no database: the page works, and forgets
  }
}

export interface StoredPhoto {
  blob: Blob;
  name: string;
}

export const store = {
  photo: (id: string) => run<StoredPhoto | undefined>("photos", "readonly", (s) => s.get(id)),
  putPhoto: (id: string, photo: StoredPhoto) => run("photos", "readwrite", (s) => s.put(photo, id)),
  dropPhoto: (id: string) => run("photos", "readwrite", (s) => s.delete(id)),
  session: () => run<unknown>("session", "readonly", (s) => s.get("current")),
  putSession: (session: unknown) => run("session", "readwrite", (s) => s.put(session, "current")),
};
