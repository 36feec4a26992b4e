using System;
using System.Diagnostics;
using System.IO;
using System.Threading;
using System.Threading.Tasks;
using UnityEngine;

namespace Gsac
{
    /// <summary>Avatars at run time, in players too.</summary>
    public static class GsacLoader
    {
        const int Slice = 2; // ms of a frame

        /// <summary>bytes: of a .gsac file, from disk or network. Throws GsacException.</summary>
        public static GsacAvatar Load(byte[] bytes, string name)
        {
            var person = new GameObject(name);
            try
            {
                var avatar = person.AddComponent<GsacAvatar>();
                avatar.Use(bytes);
                return avatar;
            }
            catch
            {
                GsacCameras.Free(person);
                throw;
            }
        }

        /// <summary>
        /// As Load, without a halt: the file is read and parsed on another thread, its buffers go to the GPU a few a frame. Call it on
        /// the main thread. Throws GsacException that names the file, what reading a file throws, or OperationCanceledException, also
        /// where play mode ended meanwhile; nothing is left in the scene then.
        /// </summary>
        public static async Task<GsacAvatar> LoadAsync(string path, CancellationToken cancel = default(CancellationToken))
        {
            byte[] bytes = await Named(path, () => GsacData.Load(path), cancel);
            return await LoadAsync(bytes, Path.GetFileNameWithoutExtension(path), path, cancel);
        }

        /// <summary>
        /// From an address, https:// or file://. digest: SHA-256 of the file, which is refused where it has another; null: any. most: bytes that
        /// are accepted. Throws as the one by path, and IOException that names the address.
        /// </summary>
        public static async Task<GsacAvatar> LoadAsync(Uri address, string digest = null, long most = GsacContainer.MaxFile,
                                                       CancellationToken cancel = default(CancellationToken))
        {
            byte[] bytes = await Task.Run(() => GsacAddress.Read(address, digest, Math.Min(most, GsacContainer.MaxFile), cancel), cancel);
            string file = address.ToString();
            return await LoadAsync(bytes, Path.GetFileNameWithoutExtension(address.LocalPath), file, cancel);
        }

        /// <summary>bytes: of a .gsac file; where it does not lie on disk, such as in an Android player's own assets. name: of the person.</summary>
        public static Task<GsacAvatar> LoadAsync(byte[] bytes, string name, CancellationToken cancel = default(CancellationToken))
        {
            return LoadAsync(bytes, name, name, cancel);
        }

        static async Task<GsacAvatar> LoadAsync(byte[] bytes, string name, string file, CancellationToken cancel)
        {
            bool playing = Application.isPlaying;
            GsacModel read = await Named(file, () => GsacModel.Read(bytes, bytes), cancel);
            Go(playing, cancel);
            GsacModel model = GsacModel.Acquire(read);
            try
            {
                Stopwatch clock = Stopwatch.StartNew();
                // a device without them is told by the renderer
                while (SystemInfo.supportsComputeShaders && model.UploadPart())
                {
                    if (clock.ElapsedMilliseconds < Slice) continue;
                    await Task.Yield();
                    Go(playing, cancel);
                    clock.Restart();
                }
                return Load(bytes, name);
            }
            finally
            {
                model.Release();
            }
        }

        /// <summary>Done on another thread.</summary>
        static async Task<T> Named<T>(string file, Func<T> work, CancellationToken cancel)
        {
            try
            {
                return await Task.Run(work, cancel);
            }
            catch (GsacException e)
            {
                throw new GsacException(file, e);
            }
        }

        static void Go(bool playing, CancellationToken cancel)
        {
            cancel.ThrowIfCancellationRequested();
            if (Application.isPlaying != playing) throw new OperationCanceledException("play mode has ended");
        }
    }
}
