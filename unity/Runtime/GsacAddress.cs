using System;
using System.IO;
using System.Net;
using System.Security.Cryptography;
using System.Threading;

namespace Gsac
{
    /// <summary>The bytes that lie under an address: of a file, or of a server by https. What comes is not believed: it has a largest size and may have a digest.</summary>
    public static class GsacAddress
    {
        const int Patience = 30; // s: without a byte
        const int MostTurns = 5; // of a server to another address

        /// <summary>
        /// Waits; call it on another thread. digest: SHA-256 of the bytes, 64 hexadecimal digits, null: any; most: bytes. Throws
        /// ArgumentException for an address or digest that cannot be one, IOException that names the address, OperationCanceledException.
        /// </summary>
        public static byte[] Read(Uri address, string digest, long most, CancellationToken cancel)
        {
            if (digest != null && !IsDigest(digest)) throw new ArgumentException("the digest `" + digest + "` is not SHA-256's 64 hexadecimal digits");
            byte[] bytes = ReadAny(address, most, cancel);
            string found = digest == null ? null : Digest(bytes);
            if (found != null && !string.Equals(found, digest, StringComparison.OrdinalIgnoreCase))
            {
                throw new IOException(address + ": other bytes than expected, their SHA-256 is " + found + " and not " + digest + "; get the file anew or correct the digest");
            }
            return bytes;
        }

        static byte[] ReadAny(Uri address, long most, CancellationToken cancel)
        {
            for (int turns = 0; turns <= MostTurns; turns++)
            {
                Check(address);
                if (address.IsFile) return ReadFile(address, most, cancel);
                byte[] bytes;
                Uri next = ReadServer(address, most, cancel, out bytes);
                if (next == null) return bytes;
                // nor may it turn to a file of this machine
                if (next.Scheme != Uri.UriSchemeHttps) throw new IOException(address + ": the server turns to `" + next + "`, which is not https");
                address = next;
            }
            throw new IOException(address + ": the server turns to other addresses without end");
        }

        static void Check(Uri address)
        {
            bool possible = address.IsAbsoluteUri && (address.IsFile || address.Scheme == Uri.UriSchemeHttps);
            if (!possible) throw new ArgumentException("`" + address + "` is no address for avatars; give one that begins with https:// or file://");
        }

        static byte[] ReadFile(Uri address, long most, CancellationToken cancel)
        {
            using (FileStream file = File.OpenRead(address.LocalPath)) return ReadAll(address, file, file.Length, most, cancel);
        }

        /// <summary>The address to which the server turns, or null and the bytes.</summary>
        static Uri ReadServer(Uri address, long most, CancellationToken cancel, out byte[] bytes)
        {
            bytes = null;
            HttpWebRequest request = WebRequest.CreateHttp(address);
            request.AllowAutoRedirect = false; // each address is looked at
            request.Timeout = request.ReadWriteTimeout = Patience * 1000;
            try
            {
                using (cancel.Register(request.Abort))
                using (var answer = (HttpWebResponse)request.GetResponse())
                {
                    int code = (int)answer.StatusCode;
                    string place = answer.Headers[HttpResponseHeader.Location];
                    if (code >= 300 && code < 400 && place != null) return new Uri(address, place);
                    if (code != 200) throw new IOException(address + ": the server answers " + code + " " + answer.StatusDescription);
                    using (Stream stream = answer.GetResponseStream()) bytes = ReadAll(address, stream, answer.ContentLength, most, cancel);
                    return null;
                }
            }
            catch (WebException e)
            {
                cancel.ThrowIfCancellationRequested();
                throw new IOException(address + ": " + e.Message, e);
            }
        }

        /// <summary>length: bytes that are announced, negative where that is not said.</summary>
        static byte[] ReadAll(Uri address, Stream stream, long length, long most, CancellationToken cancel)
        {
            if (length > most) throw TooLarge(address, most);
            using (var all = new MemoryStream((int)Math.Max(0, length)))
            {
                var part = new byte[1 << 16];
                for (int count = stream.Read(part, 0, part.Length); count > 0; count = stream.Read(part, 0, part.Length))
                {
                    cancel.ThrowIfCancellationRequested();
                    if (all.Length + count > most) throw TooLarge(address, most);
                    all.Write(part, 0, count);
                }
                if (length >= 0 && all.Length != length) throw new IOException(address + ": " + all.Length + " of " + length + " bytes came; try again");
                return all.ToArray();
            }
        }

        static IOException TooLarge(Uri address, long most)
        {
            return new IOException(address + ": more than the " + most + " bytes that are accepted");
        }

        static bool IsDigest(string word)
        {
            if (word.Length != 64) return false;
            foreach (char c in word)
            {
                if (!Uri.IsHexDigit(c)) return false;
            }
            return true;
        }

        static string Digest(byte[] bytes)
        {
            using (SHA256 sha = SHA256.Create()) return BitConverter.ToString(sha.ComputeHash(bytes)).Replace("-", "").ToLowerInvariant();
        }
    }
}
