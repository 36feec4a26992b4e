using UnityEngine;

namespace Gsac
{
    /// <summary>Avatars at run time, in players too.</summary>
    public static class GsacLoader
    {
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
                Object.Destroy(person);
                throw;
            }
        }
    }
}
